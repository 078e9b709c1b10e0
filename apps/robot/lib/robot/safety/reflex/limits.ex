defmodule Robot.Safety.Reflex.Limits do
  @moduledoc false
  # Applies the limits of the robot's speeds, its surroundings and its fence to a wish that may be
  # carried out: those from `:speed` to `:bumper` in the table of `Robot.Safety.Reflex`, one
  # after the other. Pure.
  alias Hal.Drive.SlewLimiter
  alias Hal.Twist
  alias Robot.Safety.Reflex
  alias Robot.Fence
  alias Robot.Safety.Reflex.Body

  @blind_ms 500
  @blind_speed 0.1
  # A lidar is a device of its own: while it is as silent as that, nothing else stops the wheels.
  @unseen_ms 2_000
  # A place that is older than this counts as unknown.
  @lost_ms 500
  # The time step of the ramp is never longer than this, even if the clock jumped.
  @longest_step_ms 200

  @doc """
  The speed (m/s) and turn rate (rad/s) that remain of those wished, at this time in milliseconds,
  and the limits that reduced them, in the order in which they were applied.
  """
  @spec limit(Reflex.t(), float(), float(), integer()) :: {Twist.t(), [Reflex.limit()]}
  def limit(reflex, linear, turn, at_ms) do
    %{profile: profile, twist: last} = reflex
    {linear, turn, limits} = speed(linear, turn, profile, [])
    {safe_linear, limits} = linear |> near(reflex, at_ms, limits)
    {safe_turn, limits} = corner(turn, reflex, at_ms, limits)
    {safe_linear, limits} = fence(safe_linear, safe_turn, reflex, at_ms, limits)
    seconds = step_s(reflex.at_ms, at_ms)

    {ramped, limits} = ramp(last.linear, safe_linear, profile.max_acceleration * seconds, limits)

    {turned, limits} = ramp(last.turn, safe_turn, profile.max_turn_acceleration * seconds, limits)

    # The bumper limit comes after the ramp, because it stops without one.
    {ramped, limits} = bumper(ramped, reflex, limits)
    {Twist.new(ramped, turned), Enum.reverse(limits)}
  end

  defp speed(linear, turn, profile, limits) do
    safe_linear = clamp(linear, profile.max_linear)
    safe_turn = clamp(turn, profile.max_turn)
    changed? = safe_linear != linear or safe_turn != turn
    {safe_linear, safe_turn, if(changed?, do: [:speed | limits], else: limits)}
  end

  defp near(linear, reflex, at_ms, limits) do
    if blind?(reflex, at_ms) do
      lower(linear, blind_speed(reflex, at_ms), :blind, limits)
    else
      points = reflex.scan ++ reflex.sonar
      profile = reflex.profile
      {linear, limits} = lower(linear, Body.free_speed(profile, points, linear), :near, limits)
      lower(linear, Body.passing_speed(profile, points, linear), :beside, limits)
    end
  end

  defp blind?(%{profile: profile} = reflex, at_ms) do
    (profile.sonars != [] and older?(reflex.sonar_at_ms, @blind_ms, at_ms)) or
      (profile.scan != nil and older?(reflex.scan_at_ms, @blind_ms, at_ms))
  end

  defp blind_speed(%{profile: %{scan: nil}}, _at_ms), do: @blind_speed

  defp blind_speed(%{scan_at_ms: scan_at_ms}, at_ms),
    do: if(older?(scan_at_ms, @unseen_ms, at_ms), do: 0.0, else: @blind_speed)

  defp older?(nil, _most_ms, _at_ms), do: true
  defp older?(then_ms, most_ms, at_ms), do: at_ms - then_ms > most_ms

  # What was seen last still counts, but not as all that there is.
  defp corner(turn, reflex, at_ms, limits) do
    free = Body.free_turn(reflex.profile, reflex.scan ++ reflex.sonar, turn)
    {turn, limits} = lower(turn, free, :corner, limits)

    if blind?(reflex, at_ms),
      do: lower(turn, Body.turn_at(reflex.profile, blind_speed(reflex, at_ms)), :blind, limits),
      else: {turn, limits}
  end

  defp fence(linear, _turn, %{fence: nil}, _at_ms, limits), do: {linear, limits}

  defp fence(linear, turn, %{place: {pose, then_ms}} = reflex, at_ms, limits)
       when at_ms - then_ms <= @lost_ms do
    # The turn rate changes from the present one to the new one, so both are checked.
    turns = Enum.uniq([reflex.twist.turn, turn])
    age_s = max(at_ms - then_ms, 0) / 1000
    free = Fence.free_speed(reflex.fence, reflex.profile, pose, linear, turns, age_s)
    lower(linear, free, :fence, limits)
  end

  defp fence(linear, _turn, _lost, _at_ms, limits), do: lower(linear, 0.0, :fence, limits)

  defp bumper(linear, %{bumpers: []}, limits), do: {linear, limits}

  defp bumper(linear, reflex, limits) do
    count = max(reflex.profile.bumpers, 1)

    toward? =
      Enum.any?(reflex.bumpers, fn segment ->
        is_integer(segment) and
          :math.cos(2 * :math.pi() * segment / count) * linear > 0.05 * abs(linear)
      end)

    if toward? and linear != 0.0, do: {0.0, [:bumper | limits]}, else: {linear, limits}
  end

  defp lower(value, limit, name, limits) do
    if abs(value) > limit,
      do: {clamp(value, limit), [name | List.delete(limits, name)]},
      else: {value, limits}
  end

  # Braking may be twice as hard as speeding up, because obstacles are detected with a delay.
  defp ramp(from, to, most, limits) do
    case SlewLimiter.approach(from, to, most, 2 * most) do
      ramped when ramped == to -> {to, limits}
      ramped -> {ramped, [:acceleration | limits]}
    end
  end

  defp step_s(nil, _at_ms), do: 0.05

  defp step_s(last_ms, at_ms),
    do: (at_ms - last_ms) |> max(0) |> min(@longest_step_ms) |> Kernel./(1000)

  defp clamp(value, limit) when value > limit, do: limit * 1.0
  defp clamp(value, limit) when value < -limit, do: -limit * 1.0
  defp clamp(value, _limit), do: value
end
