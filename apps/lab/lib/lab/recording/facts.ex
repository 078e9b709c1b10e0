defmodule Lab.Recording.Facts do
  @moduledoc "Describes what a recording says of a run in words and numbers, for plots and logs. Pure."
  alias Hal.{Json, Pose, Twist}
  alias Mcap.Foxglove
  alias Record.Recording.Drawing
  alias Sim.Scene
  alias Swarm.Message

  @doc "Something that happened, as a line of a log."
  @spec stage(non_neg_integer(), Scene.stage()) :: iodata()
  def stage(ns, %{stage: stage} = about),
    do:
      Drawing.stage(ns, about[:robot] || :fleet, stage, Map.drop(about, [:stage, :at_s, :robot]))

  @doc "The numbers of the formation."
  @spec mission(Scene.t()) :: iodata()
  def mission(scene) do
    {mean, most} = scene.error || {nil, nil}

    Json.encode!(
      {:object,
       [
         leader: scene.leader,
         epoch: scene.epoch,
         formed: scene.formed?,
         error_mean_m: mean,
         error_max_m: most
       ]}
    )
  end

  @typedoc """
  What a tick's entries say to viewers: each message and its sender (in a heartbeat with its believed place), at
  what speed each drives, and what each camera saw.
  """
  @type t :: %{
          sent: [{atom(), to :: term(), kind :: atom() | nil, Pose.t() | nil}],
          speeds: %{atom() => Twist.t()},
          seen: [{atom(), Vision.Detections.t()}]
        }

  @doc "What a tick's entries say to viewers: little, because it goes to another process."
  @spec of([Lab.Trial.entry()]) :: t()
  def of(entries) do
    facts = Enum.reduce(entries, %{sent: [], speeds: %{}, seen: []}, &entry/2)
    %{facts | sent: Enum.reverse(facts.sent), seen: Enum.reverse(facts.seen)}
  end

  defp entry({:step, id, {:detections, seen}, []}, facts),
    do: %{facts | seen: [{id, seen} | facts.seen]}

  defp entry({:step, id, _input, [_ | _] = effects}, facts),
    do: Enum.reduce(effects, facts, &effect(&1, id, &2))

  defp entry(_other, facts), do: facts

  defp effect({:drive, twist}, id, facts), do: %{facts | speeds: Map.put(facts.speeds, id, twist)}

  defp effect({:send, to, %Message{kind: kind} = message}, id, facts),
    do: %{facts | sent: [{id, to, kind, pose(message)} | facts.sent]}

  defp effect(_other, _id, facts), do: facts

  # A heartbeat says where its robot believes to be, in mm and mrad.
  defp pose(%Message{kind: :heartbeat, body: %{pose: {x, y, heading}}}),
    do: Pose.new(x / 1000, y / 1000, heading / 1000)

  defp pose(_message), do: nil

  @doc """
  The messages of a tick, and with `poses?` where robots told the others to be:
  `{{robot, topic} | topic, data}`.
  """
  @spec sent(non_neg_integer(), t(), poses? :: boolean()) :: [{term(), iodata()}]
  def sent(_ns, %{sent: []}, _poses?), do: []

  def sent(ns, %{sent: sent}, poses?) do
    poses =
      for {id, _to, _kind, %Pose{} = pose} <- sent,
          poses?,
          do: {{id, :pose}, Foxglove.pose_in_frame(ns, "map", pose)}

    messages = for {from, to, kind, _pose} <- sent, do: Drawing.message(from, to, kind)
    [{"/messages", Json.encode!({:object, messages: messages})} | poses]
  end

  @doc "What the cameras saw, and how the living robots stand at the end of a tick, as `sent/2`."
  @spec robots(t(), Scene.t()) :: [{term(), iodata()}]
  def robots(facts, scene) do
    for({id, seen} <- facts.seen, do: {{id, :blobs}, Drawing.blobs(seen)}) ++
      for(
        robot <- scene.robots,
        robot.alive,
        do: {{robot.id, :state}, state(robot, facts.speeds[robot.id])}
      )
  end

  @doc "How a robot stands, and at what speed it is told to drive, if that is known, as plain JSON."
  @spec state(Scene.robot(), Twist.t() | nil) :: iodata()
  def state(robot, speed) do
    facts = [
      phase: robot.state,
      leads: robot.leader?,
      error_m: Scene.slot_error(robot),
      within_m: robot.uncertainty,
      size_ppm: robot.size_ppm
    ]

    Json.encode!({:object, facts ++ speed(speed)})
  end

  defp speed(nil), do: []
  defp speed(%Twist{linear: linear, turn: turn}), do: [speed_m_s: linear, turn_rad_s: turn]
end
