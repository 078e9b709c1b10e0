defmodule Robot.Localiser.Walls do
  @moduledoc """
  Corrects a belief by what the sonars hear of the walls of a floor plan (`Nav.Grid`). Pure.

  Every few decimetres each range is compared with that of the flat wall which its sonar should face squarely
  (`Robot.Localiser.Walls.Facing`), and is a measurement of the extended Kalman filter `Robot.Localiser.Belief` along the normal of
  that wall. A gate leaves out what something else explains. The readings of a robot by the same walls are not independent, so
  they count as less exact than they are, and never make the pose surer than the plan is.

  A plan may be wrong: of another floor, or drawn before a wall was moved. `Robot.Localiser.Walls.Trust` decides that. The belief
  without the corrections since the plan was last surely right is kept (`dead`), and takes over when the plan is found to be
  wrong, so that the robot goes on by dead reckoning.
  """
  alias Hal.Pose
  alias Robot.Localiser.Belief
  alias Robot.Localiser.Walls.{Facing, Trust}
  alias Nav.Grid
  alias Nav.OccupancyGrid.Cones
  alias Robot.Percept

  # A round of readings is taken after so much way or turn (metres, radians).
  @moved 0.25
  @turned 0.2
  # The sonars of a robot that turns faster than this within a round of them point elsewhere by then (radians).
  @blurred 0.2
  # Walls between these (metres) count.
  @near 0.2
  @far 4.5
  # The standard deviation of a range (metres), several times that of a sonar, and how exact a plan is.
  @sd 0.15
  @exact 0.04
  # Above this uncertainty (metres, radians) an echo may be matched to the wrong wall. Such a pose is corrected only
  # once readings have shown that it was right all the same, as well as those of a pose that is known by `@right`.
  @vague {1.0, 0.8}
  @right 0.3
  @gate 9.0
  # The evidence by which readings have shown that a plan is right.
  @shown 40.0

  defstruct at: nil, dead: nil, trust: %Trust{}, vague?: false

  @typedoc "`at` is the odometry at the last round, at which the pose was `vague?` or not."
  @type t :: %__MODULE__{
          at: Pose.t() | nil,
          dead: Belief.t() | nil,
          trust: Trust.t(),
          vague?: boolean()
        }

  @doc "Whether readings have shown that the plan is right, which is trusted before there are any."
  @spec right?(t()) :: boolean()
  def right?(%__MODULE__{trust: trust}), do: trust.trusted? and trust.could >= @shown

  @doc "The belief corrected by the percept's sonars, if its `grid` is a floor plan and a round is due."
  @spec correct(t(), Belief.t(), Percept.t()) :: {t(), Belief.t()}
  def correct(walls, belief, %Percept{sonar: ranges, grid: %Grid{closed?: true}} = percept)
      when ranges != nil do
    now = percept.odometry.pose

    cond do
      walls.at == nil ->
        {%{walls | at: now, dead: belief}, belief}

      Cones.moved?(walls.at, now, @moved, @turned) and not blurred?(percept) ->
        dead = Belief.move(walls.dead, Pose.relative(walls.at, now))
        listen(%{walls | at: now, dead: dead}, belief, percept)

      true ->
        {walls, belief}
    end
  end

  def correct(walls, belief, _percept), do: {walls, belief}

  defp blurred?(%{odometry: odometry, profile: profile}),
    do: abs(odometry.twist.turn) * profile.sonar_round_s > @blurred

  defp listen(walls, belief, percept) do
    vague? = vague?(belief)
    walls = if vague? and not walls.vague?, do: %{walls | trust: Trust.none()}, else: walls
    walls = %{walls | vague?: vague?}
    {corrected, got, could} = round(belief, percept, if(vague?, do: @right * @right))
    {verdict, trust} = Trust.weigh(walls.trust, got, could)
    verdict = if vague? and verdict == :fair, do: :unfair, else: verdict
    follow(verdict, %{walls | trust: trust}, belief, corrected, walls.trust.trusted?)
  end

  defp vague?(belief) do
    {worst, _least, heading} = Belief.sd(belief)
    {position, turn} = @vague
    worst > position or heading > turn
  end

  defp follow(:right, walls, _belief, corrected, _trusted?),
    do: {%{walls | dead: corrected}, corrected}

  defp follow(:fair, walls, _belief, corrected, _trusted?), do: {walls, corrected}
  defp follow(:unfair, walls, belief, _corrected, _trusted?), do: {walls, belief}
  defp follow(:wrong, walls, _belief, _corrected, true), do: {walls, walls.dead}
  defp follow(:wrong, walls, belief, _corrected, false), do: {%{walls | dead: belief}, belief}

  # One reading after the other, so that the second one by the same wall is expected where the first one was.
  # `most` is the variance (m2) that is expected at most; `nil` is more than any number.
  defp round(belief, %{profile: profile, odometry: odometry} = percept, most) do
    late = odometry.twist.linear * profile.sonar_round_s / 2
    noise = @sd * @sd + late * late

    for {mount, range} <- Enum.zip(profile.sonars, percept.sonar),
        is_number(range),
        sonar = Pose.compose(belief.pose, mount),
        {distance, normal} <- faced(percept.grid, sonar, profile),
        not others?(percept, sonar, range),
        reduce: {belief, 0.0, 0.0} do
      {now, got, could} ->
        slope = slope(belief.pose, sonar, normal)
        variance = Belief.variance(now, slope)
        s = min(variance, most) + noise
        error = range - distance - along(slope, belief.pose, now.pose)

        corrected =
          if variance > @exact * @exact and error * error <= @gate * s,
            do: Belief.measured(now, error, slope, noise),
            else: now

        {corrected, got + Trust.evidence(error, s), could + Trust.evidence(0.0, s)}
    end
  end

  defp faced(grid, sonar, profile) do
    case Facing.find(grid, sonar, profile.sonar_cone, min(@far, profile.sonar_max)) do
      {distance, _normal} = faced when distance > @near -> [faced]
      _none -> []
    end
  end

  @doc "Whether an echo heard by a sonar at this pose (in the frame of the percept's peers) may be that of another robot."
  @spec others?(Percept.t(), sonar :: Pose.t(), range :: float()) :: boolean()
  def others?(%{peers: peers}, _sonar, _range) when peers == %{}, do: false

  def others?(%{peers: peers, profile: profile}, sonar, range) do
    Enum.any?(peers, fn {_id, %{pose: pose, radius: radius}} ->
      Cones.sent?({pose.x, pose.y, radius}, sonar, range, profile.sonar_cone)
    end)
  end

  # The sonar swings about the middle of the robot as that turns.
  defp slope(pose, sonar, {nx, ny}),
    do: {nx, ny, ny * (sonar.x - pose.x) - nx * (sonar.y - pose.y)}

  defp along({a, b, c}, from, to),
    do: a * (to.x - from.x) + b * (to.y - from.y) + c * Pose.wrap(to.heading - from.heading)
end
