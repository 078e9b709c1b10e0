defmodule Robot.Localiser.Walls do
  @moduledoc """
  Corrects a belief by what the sonars hear of the walls of a floor plan. Pure.
  """
  alias Hal.Pose
  alias Robot.Localiser.Belief
  alias Robot.Localiser.Walls.Facing
  alias Robot.Navigation.Grid
  alias Robot.Percept

  # Echoes of walls between these (metres) count.
  @near 0.2
  @far 4.5
  # Readings are taken after so much way or turn (metres, radians).
  @moved 0.15
  @turned 0.2
  @sd 0.15
  # The pose is not made surer than this by walls: the plan is not more exact (metres).
  @exact 0.04
  @share 0.2
  @enough 0.6

  defstruct at: nil, trust: 0.0

  @type t :: %__MODULE__{at: Pose.t() | nil, trust: float()}

  @spec correct(t(), Belief.t(), Percept.t()) :: {t(), Belief.t()}
  def correct(walls, belief, %Percept{sonar: ranges, grid: %Grid{closed?: true}} = percept)
      when ranges != nil do
    if due?(walls.at, percept.odometry.pose),
      do: listen(%{walls | at: percept.odometry.pose}, belief, percept),
      else: {walls, belief}
  end

  def correct(walls, belief, _percept), do: {walls, belief}

  defp due?(nil, _now), do: true

  defp due?(last, now),
    do:
      Pose.distance(last, now) > @moved or
        abs(Pose.wrap(now.heading - last.heading)) > @turned

  defp listen(walls, belief, %{profile: profile, odometry: odometry} = percept) do
    late = odometry.twist.linear * profile.sonar_round_s / 2
    noise = @sd * @sd + late * late

    faced =
      for {mount, range} <- Enum.zip(profile.sonars, percept.sonar),
          is_number(range),
          {distance, normal} <- faced(percept.grid, belief.pose, mount, profile),
          do: {range - distance, slope(belief.pose, mount, normal)}

    fits = Enum.filter(faced, fn {error, slope} -> Belief.fits?(belief, error, slope, noise) end)
    walls = if faced == [], do: walls, else: trust(walls, length(fits) / length(faced))
    {walls, if(walls.trust >= @enough, do: pull(belief, fits, noise), else: belief)}
  end

  defp trust(walls, share), do: %{walls | trust: walls.trust + @share * (share - walls.trust)}

  defp pull(belief, fits, noise) do
    Enum.reduce(fits, belief, fn {error, slope}, belief ->
      if Belief.variance(belief, slope) > @exact * @exact,
        do: Belief.measured(belief, error, slope, noise),
        else: belief
    end)
  end

  defp faced(grid, pose, mount, profile) do
    case Facing.find(grid, Pose.compose(pose, mount), profile.sonar_cone, @far) do
      {distance, _normal} = faced when distance > @near -> [faced]
      _none -> []
    end
  end

  # The sonar swings about the middle of the robot as it turns.
  defp slope(pose, mount, {nx, ny}) do
    {x, y} = Pose.place(pose, {mount.x, mount.y})
    {nx, ny, ny * (x - pose.x) - nx * (y - pose.y)}
  end
end
