defmodule Robot.Behaviour.Blocker do
  @moduledoc """
  Finds what keeps a robot from a place, from what it knows about its surroundings. Pure.

  | blocker | is |
  |---|---|
  | `{:robot, id}` | a robot, dead, standing or passing, in the place or on the way |
  | `:unknown` | something that the sonars see, and that neither a robot has reported nor the map shows |
  | `:no_turn` | what is so near to its corners that its gate does not let it turn |
  | `:no_way` | none of these: known obstacles leave no way, or the robot finds none |

  Missions add marks of their own.
  """
  alias Hal.Pose
  alias Robot.Behaviour.Avoid.{BackOut, Neighbours}
  alias Robot.Percept

  # The room that a robot needs beside its body, and the length of its way that is checked, in
  # metres.
  @clear 0.1
  @ahead 1.5
  # An echo so near to a wall of the map (metres) is the wall's.
  @wall 0.15

  @type t :: {:robot, atom()} | :unknown | :no_turn | :no_way
  @typedoc "A thing, its place and its radius in metres."
  @type mark :: {what :: term(), Pose.point(), radius :: float()}

  @doc """
  The blocker between a percept's pose and a place, both in the map frame in metres, or the mark that is it. A blocker in the
  place comes first, then the nearest one on the first 1.5 m of the straight way; but one that may not turn gets nowhere.
  """
  @spec find(Percept.t(), Pose.point(), [mark()]) :: t() | term()
  def find(percept, place, marks \\ []),
    do: if(BackOut.refused?(percept), do: :no_turn, else: near(percept, place, marks))

  defp near(%Percept{pose: pose, profile: profile} = percept, place, marks) do
    things = things(percept, marks)
    room = profile.radius + @clear
    end_of_look = ahead(pose, place)

    nearest(things, &Pose.distance(place, &1), room, place) ||
      nearest(things, &aside(&1, Pose.point(pose), end_of_look), room, pose) || :no_way
  end

  @doc """
  A blocker in words, to follow "blocked by".

      iex> for b <- [{:robot, :mag2}, :no_way, nil], do: Robot.Behaviour.Blocker.words(b)
      ["mag2", "no way", nil]
  """
  @spec words(t() | nil) :: String.t() | nil
  def words(nil), do: nil
  def words({:robot, id}), do: Atom.to_string(id)
  def words(:no_turn), do: "no room to turn"
  def words(:unknown), do: "something unknown"
  def words(:no_way), do: "no way"

  defp things(percept, marks) do
    robots = for {id, peer} <- Enum.sort(percept.peers), do: {{:robot, id}, peer}
    bodies = for {what, peer} <- robots, do: {what, Pose.point(peer.pose), peer.radius}
    known = for {_what, {x, y}, radius} <- marks ++ bodies, do: {x, y, radius}

    seen = percept |> Neighbours.unknown(known) |> Neighbours.but_walls(percept, @wall)
    seen = for thing <- seen, do: {:unknown, thing.at, thing.radius}

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

  defp ahead(pose, {x, y} = place) do
    way = Pose.distance(pose, place)
    share = if way > @ahead, do: @ahead / way, else: 1.0
    {pose.x + (x - pose.x) * share, pose.y + (y - pose.y) * share}
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
