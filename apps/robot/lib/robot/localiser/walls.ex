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
  # Nothing is corrected that is less sure than this (metres, radians): the expected ranges would be those of other walls.
  @vague {1.0, 0.4}
  @gate 9.0
  # A reading that has nothing to do with the plan may have any range (per metre), and so may this share of all others.
  @any 0.2
  @stray 0.2
  # How much of the evidence of former rounds counts in the next one; what is enough; and the share of the possible evidence by
  # which the plan is trusted, and surely right.
  @kept 0.9
  @enough 10.0
  @trusted 0.5
  @right 0.75

  defstruct at: nil, dead: nil, got: 0.0, could: 0.0, trusted?: false

  @typedoc """
  `at` is the odometry at the last round, `dead` the belief without the corrections since the plan was last surely right; of the
  evidence that the readings `could` have given for the plan, they gave `got`.
  """
  @type t :: %__MODULE__{
          at: Pose.t() | nil,
          dead: Belief.t() | nil,
          got: float(),
          could: float(),
          trusted?: boolean()
        }

  @spec correct(t(), Belief.t(), Percept.t()) :: {t(), Belief.t()}
  def correct(walls, belief, %Percept{sonar: ranges, grid: %Grid{closed?: true}} = percept)
      when ranges != nil do
    now = percept.odometry.pose

    cond do
      walls.at == nil -> {%{walls | at: now, dead: belief}, belief}
      due?(walls.at, now) -> walls |> dead(now) |> listen(belief, percept)
      true -> {walls, belief}
    end
  end

  def correct(walls, belief, _percept), do: {walls, belief}

  defp due?(last, now),
    do:
      Pose.distance(last, now) > @moved or
        abs(Pose.wrap(now.heading - last.heading)) > @turned

  defp dead(walls, now),
    do: %{walls | at: now, dead: Belief.move(walls.dead, Pose.relative(walls.at, now))}

  defp listen(walls, belief, %{profile: profile, odometry: odometry} = percept) do
    late = odometry.twist.linear * profile.sonar_round_s / 2
    noise = @sd * @sd + late * late

    if vague?(belief) do
      {walls, belief}
    else
      {corrected, got, could} =
        for {mount, range} <- Enum.zip(profile.sonars, percept.sonar),
            is_number(range),
            {distance, normal} <- faced(percept.grid, belief.pose, mount, profile),
            reduce: {belief, 0.0, 0.0} do
          {now, got, could} ->
            {a, b, c} = slope = slope(belief.pose, mount, normal)
            turned = Pose.wrap(now.pose.heading - belief.pose.heading)

            moved =
              a * (now.pose.x - belief.pose.x) + b * (now.pose.y - belief.pose.y) + c * turned

            error = range - distance - moved
            variance = Belief.variance(now, slope)
            s = variance + noise

            {pull(now, error, slope, variance, noise), got + evidence(error, s),
             could + evidence(0.0, s)}
        end

      judge(walls, belief, corrected, got, could)
    end
  end

  defp judge(walls, belief, corrected, got, could) do
    walls = %{walls | got: @kept * walls.got + got, could: @kept * walls.could + could}
    trusted? = walls.could >= @enough and walls.got >= @trusted * walls.could

    cond do
      trusted? and walls.got >= @right * walls.could and got >= @right * could ->
        {%{walls | trusted?: true, dead: corrected}, corrected}

      trusted? ->
        {%{walls | trusted?: true}, if(got >= @trusted * could, do: corrected, else: belief)}

      walls.trusted? ->
        {%{walls | trusted?: false}, walls.dead}

      true ->
        {walls, belief}
    end
  end

  defp vague?(belief) do
    {worst, _least, heading} = Belief.sd(belief)
    {position, turn} = @vague
    worst > position or heading > turn
  end

  # The logarithm of how much likelier the reading is if the plan is right.
  defp evidence(error, s) do
    likely = :math.exp(-error * error / (2 * s)) / :math.sqrt(2 * :math.pi() * s)
    :math.log((1 - @stray) * likely / @any + @stray)
  end

  defp pull(belief, error, slope, variance, noise) do
    if variance > @exact * @exact and error * error <= @gate * (variance + noise),
      do: Belief.measured(belief, error, slope, noise),
      else: belief
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
