defmodule Missions.Flock.Members do
  @moduledoc false
  # Tracks the members of the flock that a robot hears: their names, how far they have come, where they tell that they
  # are. Pure.
  #
  # Each tells once a second which course it has and its leg. Its pose comes with its heartbeats, 5 times a second, in the
  # peers of the percept; a robot that is there and tells nothing, or has another course, is no member, but an obstacle.
  alias Hal.{Pose, Twist}
  alias Missions.Flock.Field
  alias Robot.Percept

  # A robot that has told nothing for so long is no member; a pose is carried on for so long; so many are remembered.
  @silent_ms 3_500
  @carry_s 0.5
  @most 256

  @typedoc "When a member was last heard, by its name."
  @type t :: %{atom() => at_ms :: integer()}
  @typedoc "A member and where it is."
  @type member :: {atom(), Pose.point()}
  @type agent :: %{
          id: atom(),
          at: Pose.point(),
          velocity: Field.vector(),
          radius: float()
        }

  @doc "A member was heard; one more than 256 is not."
  @spec hear(t(), atom(), integer()) :: t()
  def hear(heard, from, at_ms) when is_map_key(heard, from) or map_size(heard) < @most,
    do: Map.put(heard, from, at_ms)

  def hear(heard, _from, _at_ms), do: heard

  @doc "Without those that have been silent for 3.5 s."
  @spec present(t(), integer()) :: t()
  def present(heard, now_ms),
    do: :maps.filter(fn _id, at_ms -> now_ms - at_ms < @silent_ms end, heard)

  @doc "Where the members are now, by their poses and speeds, in the order of their names."
  @spec agents(t(), Percept.t()) :: [agent()]
  def agents(heard, %Percept{peers: peers, at_ms: at_ms}) do
    for {id, %{mode: :moving} = peer} <- Enum.sort(peers), is_map_key(heard, id) do
      %{pose: pose, twist: %Twist{linear: linear}} = peer
      carry_s = min(max(at_ms - peer.at_ms, 0) / 1_000, @carry_s)
      {vx, vy} = {linear * :math.cos(pose.heading), linear * :math.sin(pose.heading)}
      at = {pose.x + carry_s * vx, pose.y + carry_s * vy}
      %{id: id, at: at, velocity: {vx, vy}, radius: peer.radius}
    end
  end

  @doc """
  Whether these points hang together, each within `far` metres of another.

      iex> Missions.Flock.Members.together?([{0.0, 0.0}, {2.0, 0.0}, {1.0, 0.0}], 1.2)
      true
      iex> Missions.Flock.Members.together?([{0.0, 0.0}, {2.0, 0.0}], 1.2)
      false
  """
  @spec together?([Pose.point()], float()) :: boolean()
  def together?(points, far), do: length(groups(Enum.map(points, &{nil, &1}), far)) < 2

  @doc """
  The members by groups that hang together, each within `far` metres of another one of its group. The greatest group comes
  first; of equal ones that of the first member.

      iex> Missions.Flock.Members.groups([mag1: {0.0, 0.0}, mag2: {3.0, 0.0}, min1: {2.0, 0.0}], 1.2)
      [[min1: {2.0, 0.0}, mag2: {3.0, 0.0}], [mag1: {0.0, 0.0}]]
  """
  @spec groups([member()], far :: float()) :: [[member(), ...]]
  def groups(members, far), do: members |> split(far) |> Enum.sort_by(&(-length(&1)))

  @doc "The middle of these members."
  @spec middle([member(), ...]) :: Pose.point()
  def middle(members) do
    {x, y} = Enum.reduce(members, {0, 0}, fn {_id, {x, y}}, {ax, ay} -> {ax + x, ay + y} end)
    {x / length(members), y / length(members)}
  end

  defp split([], _far), do: []

  defp split([first | rest], far) do
    {group, others} = spread([first], [], rest, far)
    [group | split(others, far)]
  end

  # Those that hang together with the first, and the others.
  defp spread([], group, others, _far), do: {group, others}

  defp spread([{_id, at} = member | more], group, others, far) do
    {near, others} = Enum.split_with(others, fn {_id, to} -> Pose.distance(at, to) <= far end)
    spread(near ++ more, [member | group], others, far)
  end
end
