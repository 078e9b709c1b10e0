defmodule Sim.Map.Starts do
  @moduledoc "Where a fleet is switched on: spread in the room of a map, from a seed. Pure."
  alias Hal.Pose
  alias Sim.Noise

  @between 1.0
  @from_wall 0.7
  @from_landmark 1.2
  @tries 2_000

  @doc "See `Sim.Map.starts/4`."
  @spec spread(Sim.Map.t(), [{atom(), float()}], integer(), Sim.Map.point() | nil) ::
          {:ok, [Pose.t()]} | {:error, String.t()}
  def spread(map, robots, seed, landmark) do
    area = area(map.room, length(robots))

    robots
    |> Enum.with_index()
    |> Enum.reduce_while({:ok, []}, fn {{id, _radius}, index}, {:ok, poses} ->
      case Enum.find_value(0..(@tries - 1), &try(&1, index, area, map, seed, landmark, poses)) do
        nil ->
          {:halt,
           {:error,
            "no free place left for #{id}: #{length(robots)} robots do not fit into the start room of map #{map.name}"}}

        pose ->
          {:cont, {:ok, [pose | poses]}}
      end
    end)
    |> case do
      {:ok, poses} -> {:ok, Enum.reverse(poses)}
      error -> error
    end
  end

  # A few robots start where they can see each other, however large the hall; at least 4 m2 each.
  defp area({left, low, right, high}, count) do
    grow = :math.sqrt(max(1.0, count / 40))
    {x, y} = {8.0 * grow, 6.0 * grow}

    {max(left, -x) + @from_wall, max(low, -y) + @from_wall, min(right, x) - @from_wall,
     min(high, y) - @from_wall}
  end

  defp try(attempt, index, {left, low, right, high}, map, seed, landmark, poses) do
    draw = fn use -> Noise.unit(Noise.hash(seed, 0x57A27 + index, attempt, use)) end
    place = {left + draw.(0) * (right - left), low + draw.(1) * (high - low)}

    if Enum.all?(poses, &(Pose.distance(&1, place) >= @between)) and
         (landmark == nil or Pose.distance(landmark, place) >= @from_landmark) and
         Sim.Map.free?(map, place, @from_wall) do
      {x, y} = place
      Pose.new(x, y, (draw.(2) - 0.5) * 2 * :math.pi())
    end
  end
end
