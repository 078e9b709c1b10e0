defmodule Missions.Patrol.Ages do
  @moduledoc false
  # Records when any robot last saw each point: `%{number => ms}`; an unseen point is not in it, and is a day old. Pure.
  alias Hal.Pose

  @day_ms 86_400_000

  @type t :: %{non_neg_integer() => integer()}
  @typedoc "The points by number, metres."
  @type points :: %{non_neg_integer() => Pose.point()}

  @doc """
  A robot at this pose sees what is nearer than `from` metres.

      iex> Missions.Patrol.Ages.look(%{0 => 5}, %{0 => {9.0, 0.0}, 1 => {0.2, 0.0}}, Hal.Pose.new(0, 0), 0.5, 100)
      %{0 => 5, 1 => 100}
  """
  @spec look(t(), points(), Pose.t(), from :: float(), now_ms :: integer()) :: t()
  def look(seen, points, pose, from, now_ms) do
    for {number, point} <- points,
        Pose.distance(pose, point) < from,
        into: seen,
        do: {number, now_ms}
  end

  @doc """
  What another robot tells, an age in ms for each point in order of their numbers, or `nil`.

      iex> Missions.Patrol.Ages.hear(%{0 => 5}, [50, nil], 100)
      %{0 => 50}
  """
  @spec hear(t(), [non_neg_integer() | nil], now_ms :: integer()) :: t()
  def hear(seen, ages, now_ms) do
    for {age, number} <- Enum.with_index(ages), age != nil, reduce: seen do
      seen -> Map.update(seen, number, now_ms - age, &max(&1, now_ms - age))
    end
  end

  @doc "What the others are told of these points."
  @spec told(t(), points(), now_ms :: integer()) :: [non_neg_integer() | nil]
  def told(seen, points, now_ms) do
    for {number, _point} <- Enum.sort(points) do
      age_ms = of(seen, number, now_ms)
      if age_ms < @day_ms, do: age_ms
    end
  end

  @doc "How long a point was not seen, in ms."
  @spec of(t(), non_neg_integer(), now_ms :: integer()) :: non_neg_integer()
  def of(seen, number, now_ms) do
    case seen do
      %{^number => at_ms} -> now_ms - at_ms
      _never -> @day_ms
    end
  end

  @doc """
  The same for people, in seconds.

      iex> for number <- 0..1, do: Missions.Patrol.Ages.words(%{0 => 1_000}, number, 31_400)
      ["30", "never"]
  """
  @spec words(t(), non_neg_integer(), now_ms :: integer() | nil) :: String.t()
  def words(seen, number, now_ms) do
    if now_ms == nil or not is_map_key(seen, number),
      do: "never",
      else: "#{div(now_ms - seen[number], 1_000)}"
  end
end
