defmodule Robot.Navigation.Steering do
  @moduledoc """
  Converts a planar velocity to the two speeds of a differential drive, and limits the speed of
  approach. Pure.

  Turning comes before driving: beyond 60 degrees of error the robot turns on the spot, nearer to
  the wanted direction it drives the faster the better it points there. Both speeds are chosen so
  that the profile's accelerations can still stop them in time, which is what keeps a robot from
  swinging past its heading and from running over its place.
  """
  alias Hal.{Pose, Profile, Twist}

  # A part of the true braking power: the rest is for the lag of wheels and of a tick.
  @braking 0.6

  @doc """
  The speed of a robot with this heading that wants the velocity. With `reverse_from:` it
  drives backwards instead of turning round when it would have to turn by more than that (radians).

      iex> profile = Hal.Profile.magellan()
      iex> Robot.Navigation.Steering.twist({0.3, 0.0}, 0.0, profile)
      %Hal.Twist{linear: 0.3, turn: 0.0}
      iex> Robot.Navigation.Steering.twist({-0.3, 0.0}, 0.0, profile).linear
      0.0
      iex> Robot.Navigation.Steering.twist({-0.3, 0.0}, 0.0, profile, reverse_from: 2.0)
      %Hal.Twist{linear: -0.3, turn: 0.0}
  """
  @spec twist({float(), float()}, float(), Profile.t(), keyword()) :: Twist.t()
  def twist({vx, vy}, heading, %Profile{} = profile, options \\ []) do
    speed = :math.sqrt(vx * vx + vy * vy)

    if speed < 0.005 do
      Twist.zero()
    else
      error = turn_error(:math.atan2(vy, vx) - heading)
      speed = min(speed, profile.max_linear)

      if abs(error) > Keyword.get(options, :reverse_from, :infinity) do
        toward(-speed, Pose.wrap(error + :math.pi()), profile)
      else
        toward(speed, error, profile)
      end
    end
  end

  defp toward(speed, error, profile),
    do: Twist.new(speed * alignment(error), turn_rate(error, profile))

  @doc """
  An angle to turn by. What lies straight behind is always reached by turning left, so that noise
  about half a turn cannot make a robot change its controller.

      iex> Robot.Navigation.Steering.turn_error(-3.14) > 0
      true
  """
  @spec turn_error(float()) :: float()
  def turn_error(angle) do
    wrapped = Pose.wrap(angle)
    if wrapped < -3.05, do: wrapped + 2 * :math.pi(), else: wrapped
  end

  @doc """
  How much of its speed a robot may drive while it points this much aside (radians): all when it
  points there, nothing beyond 60 degrees.

      iex> {Robot.Navigation.Steering.alignment(0.0), Robot.Navigation.Steering.alignment(1.2)}
      {1.0, 0.0}
  """
  @spec alignment(float()) :: float()
  def alignment(error), do: max(0.0, 2 * :math.cos(error) - 1)

  @doc """
  The turn rate (rad/s) that takes an error of heading to zero without swinging past.

      iex> profile = Hal.Profile.atrv_mini()
      iex> {Robot.Navigation.Steering.turn_rate(3.0, profile), Robot.Navigation.Steering.turn_rate(-3.0, profile)}
      {0.8, -0.8}
  """
  @spec turn_rate(float(), Profile.t()) :: float()
  def turn_rate(error, %Profile{} = profile) do
    size = abs(error)
    stoppable = :math.sqrt(2 * @braking * profile.max_turn_acceleration * size)
    rate = profile.max_turn |> min(stoppable) |> min(2.2 * size)
    if error < 0, do: -rate, else: rate
  end

  @doc """
  The speed (m/s) at which to approach a place that is still `distance` metres away.

      iex> profile = Hal.Profile.magellan()
      iex> Robot.Navigation.Steering.approach(5.0, profile)
      0.5
      iex> Robot.Navigation.Steering.approach(0.0, profile)
      0.0
  """
  @spec approach(float(), Profile.t()) :: float()
  def approach(distance, %Profile{} = profile) do
    stoppable = :math.sqrt(2 * @braking * profile.max_acceleration * distance)
    profile.max_linear |> min(stoppable) |> min(1.3 * distance)
  end
end
