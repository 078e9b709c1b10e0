defmodule Player.Poses do
  @moduledoc """
  Decides which interpretation of sensor poses is meant if a file does not say: a sensor points
  away from the centre of its robot, so the positions decide. Pure.
  """
  alias Hal.Pose
  alias Player.Units

  # Nearer to the middle, a position gives no direction.
  @middle 1.0e-6
  # Some sensors at a corner look aside; on average over all sensors, few do.
  @least 0.5
  # In some files angles count on beyond one turn, in none beyond two.
  @turns 4 * :math.pi() + 0.01

  @type reading :: {name :: atom(), [{number(), number(), Units.angle()}]}

  @doc """
  The interpretations that the positions allow, in the order given.

      iex> Player.Poses.fit(radians: [{0, 1, 7.854}], degrees: [{0, 1, {:deg, 7.854}}])
      [:radians]
      iex> Player.Poses.fit(radians: [{1, 0, 0.0}], degrees: [{1, 0, {:deg, 0.0}}])
      [:radians, :degrees]
      iex> Player.Poses.fit(radians: [{-1, 0, 0.0}])
      []
  """
  @spec fit([reading()]) :: [atom()]
  def fit(readings) do
    for {name, places} <- readings, plausible?(places), outwards?(places), do: name
  end

  defp plausible?(places) do
    Enum.all?(places, fn
      {_x, _y, {:deg, angle}} -> abs(angle) <= 720
      {_x, _y, angle} -> abs(angle) <= @turns
    end)
  end

  defp outwards?(places) do
    cosines =
      for {x, y, angle} <- places,
          abs(x) > @middle or abs(y) > @middle,
          do: :math.cos(radians(angle) - :math.atan2(y, x))

    cosines == [] or Enum.sum(cosines) / length(cosines) >= @least
  end

  @doc """
  An angle as it is written in a robot file: within one turn.

      iex> Player.Poses.angle(7.853982)
      1.570797
      iex> Player.Poses.angle({:deg, 247.5})
      {:deg, 247.5}
  """
  @spec angle(Units.angle()) :: Units.angle()
  def angle({:deg, _degrees} = angle), do: angle

  def angle(angle) do
    if Units.radians?(angle), do: Units.radians(angle), else: Units.radians(Pose.wrap(angle))
  end

  defp radians({:deg, angle}), do: angle * :math.pi() / 180
  defp radians(angle), do: angle
end
