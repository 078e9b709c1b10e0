defmodule Swarm.Membership.Neighbours do
  @moduledoc "The robots in range of one, to compute with: `near/3`, then `map/2` or `reduce/3`. Pure."
  alias Hal.Pose

  @typedoc "A robot in range: its place, its distance (m), and its direction from here (radians)."
  @type neighbour :: %{pose: Pose.t(), distance: float(), bearing: float()}

  @doc """
  The robots within range, sorted by name, from their poses, the robot's own pose, and a range in
  metres. Without an own pose there are none.

      iex> poses = %{mag2: Hal.Pose.new(2, 0), min1: Hal.Pose.new(9, 0)}
      iex> [{:mag2, %{distance: 2.0}}] = Swarm.Membership.Neighbours.near(poses, Hal.Pose.new(0, 0), 3.0)
  """
  @spec near(%{atom() => Pose.t()}, Pose.t() | nil, number()) :: [{atom(), neighbour()}]
  def near(_poses, nil, _range), do: []

  def near(poses, own, range) do
    for {robot, pose} <- Enum.sort_by(poses, &Atom.to_string(elem(&1, 0))),
        distance = Pose.distance(own, {pose.x, pose.y}),
        distance <= range do
      {robot, %{pose: pose, distance: distance, bearing: Pose.bearing(own, {pose.x, pose.y})}}
    end
  end

  @doc """
  Applies a function of robot and neighbour to each.

      iex> near = Swarm.Membership.Neighbours.near(%{mag2: Hal.Pose.new(2, 0)}, Hal.Pose.new(0, 0), 3.0)
      iex> Swarm.Membership.Neighbours.map(near, fn _robot, neighbour -> neighbour.distance end)
      [mag2: 2.0]
  """
  @spec map([{atom(), neighbour()}], (atom(), neighbour() -> value)) :: [{atom(), value}]
        when value: term()
  def map(near, function), do: for({robot, one} <- near, do: {robot, function.(robot, one)})

  @doc """
  Reduces all neighbours to one value, in the order of their names.

      iex> near = Swarm.Membership.Neighbours.near(%{a: Hal.Pose.new(2, 0), b: Hal.Pose.new(1, 0)}, Hal.Pose.new(0, 0), 3.0)
      iex> Swarm.Membership.Neighbours.reduce(near, 0, fn _robot, neighbour, sum -> sum + neighbour.distance end)
      3.0
  """
  @spec reduce([{atom(), neighbour()}], acc, (atom(), neighbour(), acc -> acc)) :: acc
        when acc: term()
  def reduce(near, acc, function),
    do: Enum.reduce(near, acc, fn {robot, one}, acc -> function.(robot, one, acc) end)
end
