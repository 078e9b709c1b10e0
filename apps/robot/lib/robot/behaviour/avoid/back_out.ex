defmodule Robot.Behaviour.Avoid.BackOut do
  @moduledoc false
  # Backs a robot longer than wide straight out of where it cannot turn. Pure.
  #
  # Something is so near to its corners that the gate lets it turn no more (`:corner`). After 2 s of that it drives straight
  # back the way that it came, which was free then, slowly, until its sonars show room to turn, or for
  # as far as it came straight. The gate limits that as all else.
  alias Hal.{Odometry, Pose, Profile, Twist}
  alias Robot.Percept
  alias Robot.Safety.Reflex.Body

  @refused_ms 2_000
  # Wheels that have moved it by less (metres, radians) have stood.
  @stood 0.05
  @stood_turn 0.15
  @speed 0.1
  # The way that it came is remembered in steps, so far (metres); what is so near to its axis is straight.
  @step 0.03
  @remembered 1.0
  @straight 0.05
  # It backs out so far at least, at most, and for so long.
  @least 0.1
  @most 0.6
  @longest_ms 8_000
  # A turn rate (rad/s) at which it turns freely, to both sides.
  @turns 0.4

  defstruct frame: nil, path: [], refused: nil, out: nil

  @typedoc """
  `path` are the places where it was by its odometry in this `frame`, the newest first; its turns have been `refused` since it
  stood in this pose; it drives `out` from a pose, to one side, so far (metres), since when.
  """
  @type t :: %__MODULE__{
          frame: reference() | nil,
          path: [Pose.point()],
          refused: {Pose.t(), since_ms :: integer()} | nil,
          out: {Pose.t(), side :: 1 | -1, way :: float(), since_ms :: integer()} | nil
        }

  @doc "The speed (m/s) at which to drive straight now, or `nil`, and the next state."
  @spec note(t(), Percept.t()) :: {float() | nil, t()}
  def note(state, %Percept{odometry: nil}), do: {nil, state}

  def note(state, %Percept{profile: profile} = percept),
    do: if(Profile.round?(profile), do: {nil, state}, else: boxed(state, percept))

  defp boxed(state, %Percept{odometry: %Odometry{frame: frame, pose: pose}} = percept) do
    state = if state.frame == frame, do: state, else: %__MODULE__{frame: frame}
    state = %{state | path: path(state.path, pose)}
    if state.out, do: drive(state, pose, percept), else: wait(state, pose, percept)
  end

  defp path([last | _] = path, pose) do
    if Pose.distance(last, pose) < @step,
      do: path,
      else: Enum.take([Pose.point(pose) | path], ceil(@remembered / @step))
  end

  defp path([], pose), do: [Pose.point(pose)]

  defp wait(%{refused: refused} = state, pose, percept) do
    now = percept.at_ms

    cond do
      refused != nil and moved?(elem(refused, 0), pose) ->
        {nil, %{state | refused: nil}}

      not refused?(percept) ->
        {nil, state}

      refused == nil ->
        {nil, %{state | refused: {pose, now}}}

      now - elem(refused, 1) < @refused_ms ->
        {nil, state}

      true ->
        begin(%{state | refused: nil}, pose, percept)
    end
  end

  defp moved?(from, pose) do
    Pose.distance(from, pose) > @stood or
      abs(Pose.wrap(pose.heading - from.heading)) > @stood_turn
  end

  defp begin(state, pose, percept) do
    ways = for side <- [-1, 1], free?(side, percept), do: {straight(state.path, pose, side), side}

    case Enum.max(ways, fn -> nil end) do
      nil ->
        {nil, state}

      {way, side} ->
        way = way |> max(@least) |> min(@most)
        drive(%{state | out: {pose, side, way, percept.at_ms}}, pose, percept)
    end
  end

  defp free?(side, %{profile: profile} = percept),
    do: Body.free_speed(profile, points(percept), side * @speed) > @speed / 2

  # How far it came straight along its own axis from this side.
  defp straight(path, pose, side) do
    path
    |> Enum.map(&Pose.relative(pose, Pose.new(elem(&1, 0), elem(&1, 1), pose.heading)))
    |> Enum.take_while(&(abs(&1.y) <= @straight and side * &1.x >= -@straight))
    |> Enum.map(&(side * &1.x))
    |> Enum.max(fn -> 0.0 end)
  end

  defp drive(%{out: {from, side, way, since_ms}} = state, pose, percept) do
    gone = Pose.distance(from, pose)

    if gone >= way or percept.at_ms - since_ms >= @longest_ms or
         (gone >= @least and turns?(percept)) or not free?(side, percept),
       do: {nil, %{state | out: nil, refused: nil}},
       else: {side * @speed, state}
  end

  defp turns?(%{profile: profile} = percept) do
    points = points(percept)
    Enum.all?([-1.0, 1.0], &(Body.free_turn(profile, points, &1) >= @turns))
  end

  defp points(%{sonar: nil}), do: []
  defp points(%{profile: profile, sonar: ranges}), do: Body.points(profile, ranges)

  @doc "Whether the gate keeps a robot that stands from turning, because a corner would swing into something."
  @spec refused?(Percept.t()) :: boolean()
  def refused?(%Percept{driving: %{twist: %Twist{} = twist, limits: limits}}),
    do: :corner in limits and abs(twist.linear) < 0.02 and abs(twist.turn) < 0.05

  def refused?(_percept), do: false
end
