defmodule Swarm.Formation.Trail do
  @moduledoc """
  Remembers the path that a robot has driven, and places along it. Pure; metres, newest point first.

  A column along the leader's trail goes where the leader went: through the doorway that it used,
  not through the wall beside it.
  """
  alias Hal.Pose

  @step 0.1
  @most 400

  @type t :: [Pose.point()]

  @doc """
  The trail with one more pose; steps under 0.1 m are not recorded. A robot that backs has no longer behind it what it passes. Where
  one comes back to its trail, the loop is left out.

      iex> alias Swarm.Formation.Trail
      iex> [] |> Trail.note(Hal.Pose.new(0, 0)) |> Trail.note(Hal.Pose.new(0.05, 0)) |> length()
      1
      iex> Trail.note([{3.0, 0.0}, {2.0, 0.0}, {1.0, 0.0}], Hal.Pose.new(1.6, 0))
      [{1.6, 0.0}, {1.0, 0.0}]
      iex> Trail.note([{3.0, 0.0}, {2.0, 0.0}, {1.0, 0.0}], Hal.Pose.new(2.04, 0, 3.1))
      [{2.0, 0.0}, {1.0, 0.0}]
  """
  @spec note(t(), Pose.t()) :: t()
  def note([], pose), do: [Pose.point(pose)]

  def note([last | _] = trail, pose) do
    if Pose.distance(last, pose) >= @step,
      do: trail |> backed(pose) |> without_loop(pose) |> Enum.take(@most),
      else: trail
  end

  defp backed([last | _] = trail, pose) do
    if ahead?(last, pose), do: Enum.drop_while(trail, &ahead?(&1, pose)), else: trail
  end

  defp ahead?({x, y}, %Pose{x: px, y: py, heading: heading}),
    do: (x - px) * :math.cos(heading) + (y - py) * :math.sin(heading) > 0

  defp without_loop(trail, pose) do
    case Enum.find_index(trail, &(Pose.distance(&1, pose) < @step)) do
      nil -> [Pose.point(pose) | trail]
      back -> Enum.drop(trail, back)
    end
  end

  @doc """
  The place `way` metres behind `pose` along the trail, looking forward along it. If the trail is
  too short, it is extended in a straight line.

      iex> trail = [{2.0, 0.0}, {1.0, 0.0}, {1.0, -1.0}]
      iex> Swarm.Formation.Trail.behind(trail, Hal.Pose.new(2, 0), 1.5) |> Hal.Pose.distance({1.0, -0.5})
      0.0
      iex> Swarm.Formation.Trail.behind([], Hal.Pose.new(2, 0), 1.5)
      Hal.Pose.new(0.5, 0)
  """
  @spec behind(t(), Pose.t(), float()) :: Pose.t()
  def behind(trail, pose, way) do
    {x, y} = Pose.point(pose)
    back = {-:math.cos(pose.heading), -:math.sin(pose.heading)}
    walk({x, y}, trail, way, back)
  end

  defp walk({x, y}, [], way, {bx, by}),
    do: Pose.new(x + way * bx, y + way * by, :math.atan2(-by, -bx))

  defp walk({x, y} = from, [{nx, ny} = next | rest], way, back) do
    step = Pose.distance(from, next)
    back = if step > 1.0e-6, do: {(nx - x) / step, (ny - y) / step}, else: back

    if step < way,
      do: walk(next, rest, way - step, back),
      else: walk(from, [], way, back)
  end
end
