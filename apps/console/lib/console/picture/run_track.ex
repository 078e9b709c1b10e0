defmodule Console.Picture.RunTrack do
  @moduledoc false
  # Collects what a run records for its picture: each robot's path, and the formation error over time. Pure.
  #
  # A path gets a new point when its robot has moved by 2 cm, so that long waits cost nothing. A robot stands since it was
  # last 10 cm from where it is.
  alias Hal.Pose
  alias Sim.Scene

  @step_m 0.02
  @stands_m 0.1
  # One that has moved within so long (ms) is under way: a slow one, of 0.05 m/s, needs 2 s for 10 cm.
  @stands_ms 5_000

  @enforce_keys [:first, :last, :ways, :stood, :landmark, :errors, :marks]
  defstruct @enforce_keys

  @type t :: %__MODULE__{
          first: Scene.t(),
          last: Scene.t(),
          ways: %{atom() => Scene.way()},
          stood: %{atom() => {Pose.point(), since_ms :: non_neg_integer()}},
          landmark: Scene.way(),
          errors: [{at_s :: float(), mean :: float(), max :: float()}],
          marks: [{Scene.stage(), Pose.point() | nil}]
        }

  @doc "The track of a run that begins with this scene."
  @spec new(Scene.t()) :: t()
  def new(%Scene{} = scene) do
    add(
      %__MODULE__{
        first: scene,
        last: scene,
        ways: %{},
        stood: %{},
        landmark: [],
        errors: [],
        marks: []
      },
      scene
    )
  end

  @doc "The track with one more scene; lists are kept newest first."
  @spec add(t(), Scene.t()) :: t()
  def add(%__MODULE__{} = track, %Scene{} = scene) do
    %{
      track
      | last: scene,
        ways: Scene.ways(track.ways, scene, @step_m),
        stood: stood(track.stood, scene),
        landmark: Scene.way(track.landmark, scene.landmark, @step_m),
        errors: error(track.errors, scene),
        marks: mark(track.marks, scene)
    }
  end

  @doc "Since when a robot stands where it is at the end, in seconds; `nil` for one that is under way."
  @spec since_s(t(), atom()) :: float() | nil
  def since_s(%__MODULE__{stood: stood, last: last}, id) do
    {_place, since_ms} = Map.fetch!(stood, id)
    if last.at_ms - since_ms >= @stands_ms, do: since_ms / 1000
  end

  defp stood(stood, scene) do
    Map.new(scene.robots, fn %{id: id, pose: pose} ->
      case stood do
        %{^id => {place, since_ms}} ->
          if Pose.distance(place, pose) < @stands_m,
            do: {id, {place, since_ms}},
            else: {id, {Pose.point(pose), scene.at_ms}}

        _new ->
          {id, {Pose.point(pose), scene.at_ms}}
      end
    end)
  end

  defp error(errors, %Scene{error: nil}), do: errors

  defp error(errors, %Scene{error: {mean, max}} = scene),
    do: [{scene.at_ms / 1000, mean, max} | errors]

  # A stage is marked where it happened: at its robot, at the landmark, or at the leader.
  defp mark(marks, scene) do
    scene.stages
    |> Enum.drop(length(marks))
    |> Enum.reduce(marks, &[{&1, place(&1, scene)} | &2])
  end

  defp place(%{stage: :landmark_moved}, scene), do: scene.landmark

  defp place(stage, scene) do
    name = Map.get(stage, :robot) || scene.leader

    case Enum.find(scene.robots, &(&1.id == name)) do
      nil -> nil
      robot -> Pose.point(robot.pose)
    end
  end
end
