defmodule Missions.Landmark.Shape.Spots do
  @moduledoc false
  # Chooses the places of a cluster where not each follower gets to its own, or not all have one. Pure.
  alias Hal.Pose
  alias Swarm.Formation
  alias Swarm.Formation.{Ladder, Space}

  @doc """
  The places, with others for those at the `barred` points. If there are no others (`false`), a robot that stands in its own may
  be in the way of one that did not get to its: then it moves up, and the other takes its place.
  """
  @spec refill([Pose.t()], [Pose.point()], Formation.t(), Ladder.here(), Space.t()) ::
          {others? :: boolean(), [Pose.t()]}
  def refill(spots, barred, asked, here, space) do
    barred? = &(Pose.point(&1) in barred)
    kept = for spot <- spots, not barred?.(spot), do: {spot.x, spot.y, space.radius}
    left = length(spots) - length(kept)

    case Ladder.choose([:cluster], asked, left, here, %{space | bodies: space.bodies ++ kept}) do
      nil ->
        {false, swap(spots, Enum.find_index(spots, barred?), here.stand)}

      choice ->
        {spots, []} =
          Enum.map_reduce(spots, choice.spots, fn spot, others ->
            if barred?.(spot), do: {hd(others), tl(others)}, else: {spot, others}
          end)

        {true, spots}
    end
  end

  # With the nearest that is nearer to the robot than its own.
  defp swap(spots, blocked, stand) when blocked == nil or length(stand) != length(spots),
    do: spots

  defp swap(spots, blocked, stand) do
    own = Enum.at(spots, blocked)
    far = &Pose.distance(&1, Enum.at(stand, blocked))

    nearer = for {spot, k} <- Enum.with_index(spots), far.(spot) < far.(own), do: {far.(spot), k}

    case Enum.min(nearer, fn -> nil end) do
      nil ->
        spots

      {_metres, k} ->
        spots |> List.replace_at(blocked, Enum.at(spots, k)) |> List.replace_at(k, own)
    end
  end

  @doc """
  As many places as there are, and for the robots that are farthest from the leader those where they stand, if these are not
  among them; `nil` if it is not known where that is.
  """
  @spec most(Formation.t(), non_neg_integer(), Ladder.here(), Space.t()) :: [Pose.t(), ...] | nil
  def most(asked, followers, here, space) do
    places =
      Enum.find_value((followers - 1)..1//-1, [], fn count ->
        choice = Ladder.choose([:cluster], asked, count, here, space)
        choice && choice.spots
      end)

    {near, other} =
      for({x, y} <- here.stand, do: Pose.new(x, y, here.pose.heading))
      |> Enum.sort_by(&(-Pose.distance(&1, here.pose)))
      |> Enum.split_with(fn own ->
        Enum.any?(places, &(Pose.distance(&1, own) < space.radius))
      end)

    spots = Enum.take(places ++ other ++ near, followers)
    if spots != [] and length(spots) == followers, do: spots
  end
end
