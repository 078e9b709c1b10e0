defmodule Missions.Chase.Search do
  @moduledoc """
  Looks for a ball that no robot sees: a full turn, then a way to another place, and so on. Pure.

  A robot that is too near to where the ball was last, to see it on the floor before it, goes back first. Where it goes next depends on
  its name, so that not all go to one place.
  """
  alias Hal.Pose
  alias Nav.Reach

  # It sees the floor from there on.
  @sees 1.5
  @hop 2.5
  # The golden angle: no two ways in a row lead to places near each other.
  @angle 2.39996

  defstruct n: 0, kind: :turn, to: nil

  @typedoc "`n` is the number of the goal, `to` where a way leads."
  @type t :: %__MODULE__{n: non_neg_integer(), kind: :turn | :go, to: Pose.point() | nil}

  @doc "The goal now; `last` is where the ball was last seen, `nil` for never."
  @spec goal(t(), atom(), Pose.point() | nil, Robot.Percept.t(), String.t()) ::
          {Robot.Mission.order(), t()}
  def goal(%{kind: :turn} = search, _me, last, percept, colour) do
    if search.n == 0 and last != nil and Pose.distance(percept.pose, last) < @sees,
      do: go(%{search | n: 1, kind: :go, to: away(percept.pose, last)}),
      else: {{:goal, {:search, search.n}, {Robot.Behaviour.FindBlob, colour: colour}}, search}
  end

  def goal(%{kind: :go, to: nil} = search, me, _last, percept, _colour),
    do: go(%{search | to: next(search.n, me, percept)})

  def goal(search, _me, _last, _percept, _colour), do: go(search)

  defp go(%{to: {x, y}} = search),
    do: {{:goal, {:search, search.n}, {Robot.Behaviour.Goto, x: x, y: y, tolerance: 0.3}}, search}

  defp away(pose, last) do
    angle = :math.atan2(pose.y - elem(last, 1), pose.x - elem(last, 0))
    {elem(last, 0) + @sees * :math.cos(angle), elem(last, 1) + @sees * :math.sin(angle)}
  end

  defp next(n, me, %{pose: pose, grid: grid, profile: profile}) do
    first = @angle * (n + rem(:erlang.phash2(me), 97))

    places =
      for k <- 0..7,
          angle = first + k * @angle,
          do: {pose.x + @hop * :math.cos(angle), pose.y + @hop * :math.sin(angle)}

    Enum.find(
      places,
      Pose.point(pose),
      &(Reach.check(grid, Pose.point(pose), &1, profile.radius) == :ok)
    )
  end

  @doc """
  What comes after goal `n` ended: a turn that showed nothing is followed by a way, a way by a turn.

      iex> search = Missions.Chase.Search.ended(%Missions.Chase.Search{}, 0, 0)
      iex> {search.n, search.kind, Missions.Chase.Search.ended(search, 1, 1).kind}
      {1, :go, :turn}
  """
  @spec ended(t(), non_neg_integer(), integer()) :: t()
  def ended(%{n: n, kind: :turn}, n, 0), do: %__MODULE__{n: n + 1, kind: :go}
  def ended(%{n: n}, n, _outcome), do: %__MODULE__{n: n + 1}
  def ended(search, _of_another, _outcome), do: search
end
