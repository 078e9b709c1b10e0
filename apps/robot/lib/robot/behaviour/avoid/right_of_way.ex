defmodule Robot.Behaviour.Avoid.RightOfWay do
  @moduledoc false
  # Decides which of two robots goes on that meet where only one fits, by what each knows of the other's place. Pure.
  #
  # Each looks for its nearest passing place and the other's (`Nav.PassingPlace`). The one that would have to go
  # farther back goes on; of two that have about as far, the one whose name comes first. The other goes to its place, and
  # waits there until the way is free, or the other has not moved for some seconds. If they judged differently, because each
  # knows the other's place only nearly, they meet again, or stand before each other: then names decide.
  alias Hal.Pose
  alias Robot.Behaviour.Avoid.{Ahead, Neighbours}
  alias Nav.PassingPlace
  alias Robot.Percept

  # So far ahead on its way (metres) a robot looks for others, and so far for the one that it has met.
  @ahead 5.0
  @met_ahead 9.0
  # A robot with a passing place so near (metres) gets past by keeping aside.
  @easy 0.35
  # So much farther than the nearest place (metres) it goes for one where it is less in the way.
  @aside 1.0
  # The robot whose name comes first may have so much less to go back (metres).
  @first 0.3
  # Two robots so near (metres) that have been before each other for so long, no faster than so (m/s), have judged
  # differently.
  @facing 0.8
  @facing_ms 3_000
  @slow 0.1
  # The way is free when the other has been off it for so long.
  @free_ms 700
  # A robot that waits goes on if the other has stood for so long, or at last after so long; and waits so often in vain.
  @still_ms 6_000
  @longest_ms 40_000
  @often 3

  defstruct now: nil, vain: %{}, facing: nil

  @typedoc "The robot met: `place`, where it waits, `nil` if it goes on; `line`, its way, by which it sees that it is free."
  @type meeting :: %{
          id: atom(),
          place: Pose.point() | nil,
          line: [Pose.point(), ...],
          since_ms: integer(),
          moved_ms: integer(),
          on_ms: integer()
        }

  @typedoc """
  `vain` counts how often meeting each came to nothing since it last passed it; `facing` is the robot it stands before, and
  since when.
  """
  @type t :: %__MODULE__{
          now: meeting() | nil,
          vain: %{atom() => pos_integer()},
          facing: {atom(), integer()} | nil
        }

  @doc """
  Which of two goes on: each by its name and how far it has to go to a passing place (metres), `nil` if it has none. Neither need wait
  if both are beside one, and neither can if both have none.

      iex> alias Robot.Behaviour.Avoid.RightOfWay
      iex> for {a, b} <- [{0.0, 0.2}, {2.0, 0.5}, {0.5, 2.0}, {0.5, 0.7}, {nil, 4.0}, {4.0, nil}, {nil, nil}],
      ...>     do: RightOfWay.first({:mag1, a}, {:mag2, b})
      [nil, :mag1, :mag2, :mag1, :mag1, :mag2, nil]
  """
  @spec first({atom(), float() | nil}, {atom(), float() | nil}, [:by_name]) :: atom() | nil
  def first(one, other, how \\ [])
  def first({_a, nil}, {_b, nil}, _how), do: nil
  def first({a, nil}, _other, _how), do: a
  def first(_one, {b, nil}, _how), do: b
  def first({a, _back}, {b, _other_back}, [:by_name]), do: min(a, b)
  def first({a, _} = one, {b, _} = other, how) when b < a, do: first(other, one, how)
  def first({_a, x}, {_b, y}, _how) when x <= @easy and y <= @easy, do: nil
  def first({a, x}, {b, y}, _how), do: if(x + @first > y, do: a, else: b)

  @doc """
  Whether the robot goes to a place and waits there now, and the next state. `corners` are those of its way, `[]` if it has none
  yet; `robots` are all others.
  """
  @spec note(t(), [Pose.point()], Percept.t(), [Neighbours.t()]) ::
          {{:wait, Pose.point()} | :go, t()}
  def note(%__MODULE__{} = right, _corners, %Percept{grid: nil}, _robots), do: {:go, right}

  def note(%__MODULE__{now: nil} = right, corners, percept, robots) do
    line = [Pose.point(percept.pose) | corners]
    near = Enum.take_while(robots, &(&1.gap < @ahead))
    there = Enum.filter(near, &(not &1.fixed? and Ahead.oncoming?(&1, line, @ahead, percept)))
    right = face(right, there, percept)

    case Enum.find(there, &(not &1.standing? or faced?(right, &1, percept))) do
      nil -> {:go, right}
      other -> meet(right, other, line, percept, robots)
    end
  end

  def note(%__MODULE__{now: %{id: id} = now} = right, corners, percept, robots) do
    here = [Pose.point(percept.pose) | corners]
    other = Enum.find(robots, &(&1.id == id and not &1.fixed?))
    now = other && seen(now, other, if(now.place, do: now.line, else: here), percept)
    right = if now && now.place == nil, do: face(right, [other], percept), else: right

    cond do
      now == nil or free?(now, percept) ->
        note(%{right | now: nil, vain: Map.delete(right.vain, id)}, corners, percept, [])

      vain?(now, percept) ->
        note(in_vain(right, id), corners, percept, [])

      now.place != nil ->
        {{:wait, now.place}, %{right | now: now}}

      # The other goes on, too.
      faced?(right, other, percept) ->
        right |> in_vain(id) |> meet(other, here, percept, robots)

      true ->
        {:go, %{right | now: now}}
    end
  end

  @doc "Whether the robot that it meets is among these, and near: passing takes time."
  @spec near?(t(), [Neighbours.t()]) :: boolean()
  def near?(%__MODULE__{now: nil}, _robots), do: false

  def near?(%__MODULE__{now: %{id: id}}, robots),
    do: Enum.any?(robots, &(&1.id == id and &1.gap < @facing))

  defp seen(now, other, line, %{at_ms: at_ms} = percept) do
    %{
      now
      | moved_ms: if(other.standing?, do: now.moved_ms, else: at_ms),
        on_ms: if(Ahead.oncoming?(other, line, @met_ahead, percept), do: at_ms, else: now.on_ms)
    }
  end

  defp free?(now, %{at_ms: at_ms}), do: at_ms - now.on_ms >= @free_ms

  defp vain?(now, %{at_ms: at_ms}),
    do: at_ms - now.moved_ms >= @still_ms or at_ms - now.since_ms >= @longest_ms

  defp in_vain(right, id),
    do: %{right | now: nil, vain: Map.update(right.vain, id, 1, &(&1 + 1))}

  defp meet(right, %{id: id} = other, line, %{grid: grid, at_ms: at_ms} = percept, robots) do
    vain = Map.get(right.vain, id, 0)
    me = {Pose.point(percept.pose), percept.profile.radius}
    it = {other.at, other.radius}
    third = for robot <- robots, robot.id != id, do: {robot.at, robot.radius}
    how = if vain > 0 or faced?(right, other, percept), do: [:by_name], else: []

    back = fn one, {_place, radius} = two ->
      if wide?(grid, one, radius),
        do: 0.0,
        else: metres(PassingPlace.nearest(grid, one, two, third))
    end

    first =
      if vain < @often and not (wide?(grid, me, other.radius) and wide?(grid, it, elem(me, 1))),
        do: first({percept.robot, back.(me, it)}, {id, back.(it, me)}, how)

    place =
      with ^id <- first,
           {_metres, place} <- PassingPlace.nearest(grid, me, it, third, @aside),
           do: place,
           else: (_none -> nil)

    now = %{id: id, place: place, line: line, since_ms: at_ms, moved_ms: at_ms, on_ms: at_ms}

    cond do
      place != nil ->
        {{:wait, place}, %{right | now: %{now | line: [place | line]}, facing: nil}}

      first == percept.robot ->
        {:go, %{right | now: now, facing: nil}}

      true ->
        {:go, right}
    end
  end

  defp wide?(grid, {at, own}, other), do: PassingPlace.passes?(grid, at, own, other)

  defp metres({metres, _place}), do: metres
  defp metres(nil), do: nil

  # Remembers the robot that it has been facing, and since when.
  defp face(right, there, %{at_ms: at_ms}) do
    case {Enum.find(there, &(&1.gap < @facing and slow?(&1))), right.facing} do
      {nil, _before} -> %{right | facing: nil}
      {%{id: id}, {id, _since}} -> right
      {%{id: id}, _other} -> %{right | facing: {id, at_ms}}
    end
  end

  defp slow?(%{velocity: {vx, vy}}), do: vx * vx + vy * vy < @slow * @slow

  defp faced?(%{facing: {id, since_ms}}, %{id: id}, %{at_ms: at_ms}),
    do: at_ms - since_ms >= @facing_ms

  defp faced?(_right, _other, _percept), do: false
end
