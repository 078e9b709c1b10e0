defmodule Missions.Landmark.Blocker do
  @moduledoc """
  Finds what keeps a follower from its slot, from what it knows about its surroundings. Pure.

  | blocker | is |
  |---|---|
  | `:landmark` | the landmark, in the slot or on the way to it |
  | `{:robot, id}` | a robot, dead, standing or passing, in the slot or on the way |
  | `:unknown` | something that the sonars see and nobody has reported |
  | `:no_way` | none of these: known obstacles leave no way, or the robot finds none |
  | `:no_anchor` | the leader has not said where its place is |
  """
  alias Hal.Pose
  alias Robot.Behaviour.Avoid.Neighbours
  alias Robot.Percept
  alias Missions.Landmark.LandmarkTrack

  # The room that a robot needs beside its body, and the length of its way that is checked, in
  # metres.
  @clear 0.1
  @ahead 1.5

  @type t :: :landmark | {:robot, atom()} | :unknown | :no_way | :no_anchor

  @doc """
  The blocker between a percept's pose and a slot, both in the map frame in metres; `nil` as the
  landmark's place means that nobody knows it. A blocker in the slot comes first, then the nearest
  one on the first 1.5 m of the straight way.
  """
  @spec find(Percept.t(), Pose.t(), Pose.point() | nil) :: t()
  def find(%Percept{pose: pose, profile: profile} = percept, slot, landmark) do
    things = things(percept, landmark)
    room = profile.radius + @clear
    end_of_look = ahead(pose, slot)

    nearest(things, &Pose.distance(slot, &1), room, slot) ||
      nearest(things, &aside(&1, Pose.point(pose), end_of_look), room, pose) || :no_way
  end

  @doc """
  A blocker in words, to follow "blocked by".

      iex> for b <- [:landmark, {:robot, :mag2}, nil], do: Missions.Landmark.Blocker.words(b)
      ["the landmark", "mag2", nil]
  """
  @spec words(t() | nil) :: String.t() | nil
  def words(nil), do: nil
  def words(:landmark), do: "the landmark"
  def words({:robot, id}), do: Atom.to_string(id)
  def words(:unknown), do: "something unknown"
  def words(:no_way), do: "no way"
  def words(:no_anchor), do: "no word of its leader"

  defp things(percept, landmark) do
    robots = for {id, peer} <- Enum.sort(percept.peers), do: {{:robot, id}, peer}
    bodies = for {what, peer} <- robots, do: {what, Pose.point(peer.pose), peer.radius}
    marks = if landmark, do: [{:landmark, landmark, LandmarkTrack.radius()}], else: []
    known = for {_what, {x, y}, radius} <- marks ++ bodies, do: {x, y, radius}
    seen = for thing <- Neighbours.unknown(percept, known), do: {:unknown, thing.at, thing.radius}
    marks ++ bodies ++ seen
  end

  defp nearest(things, off, room, from) do
    things
    |> Enum.filter(fn {_what, at, radius} -> off.(at) < room + radius end)
    |> Enum.min_by(fn {_what, at, _radius} -> Pose.distance(from, at) end, fn -> nil end)
    |> what()
  end

  defp what(nil), do: nil
  defp what({what, _at, _radius}), do: what

  defp ahead(pose, slot) do
    way = Pose.distance(pose, slot)
    share = if way > @ahead, do: @ahead / way, else: 1.0
    {pose.x + (slot.x - pose.x) * share, pose.y + (slot.y - pose.y) * share}
  end

  # The distance of a point from the segment between two others.
  defp aside({x, y} = point, {ax, ay}, {bx, by}) do
    {dx, dy} = {bx - ax, by - ay}
    square = dx * dx + dy * dy
    share = if square > 0, do: ((x - ax) * dx + (y - ay) * dy) / square, else: 0.0
    share = share |> max(0.0) |> min(1.0)
    Pose.distance({ax + share * dx, ay + share * dy}, point)
  end
end
