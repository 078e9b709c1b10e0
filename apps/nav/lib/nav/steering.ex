defmodule Nav.Steering do
  @moduledoc """
  Converts a planar velocity to the two speeds of a differential drive, and limits the speed of
  approach. Pure.

  Turning comes before driving: with a heading error above 60 degrees the robot turns on the spot;
  the smaller the error, the faster it drives. The turn rate and the speed of approach are chosen
  so that the profile's accelerations can stop the robot in time, so that it does not overshoot
  its heading or its place.
  """
  alias Hal.{Pose, Profile, Twist}

  # The part of the profile's acceleration that is used for braking: the rest is a reserve for the
  # lag of the wheels and of a tick.
  @braking 0.6

  @doc """
  The linear speed and turn rate of a robot with this heading that wants this planar velocity.
  With `reverse_from:` it drives backwards instead of turning round if it would have to turn by
  more than that angle (radians).

      iex> profile = Hal.Profile.magellan()
      iex> Nav.Steering.twist({0.3, 0.0}, 0.0, profile)
      %Hal.Twist{linear: 0.3, turn: 0.0}
      iex> Nav.Steering.twist({-0.3, 0.0}, 0.0, profile).linear
      0.0
      iex> Nav.Steering.twist({-0.3, 0.0}, 0.0, profile, reverse_from: 2.0)
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
  The angle to turn by. A direction straight behind is reached by turning left, so that noise near
  half a turn does not make the robot change its direction of turning.

      iex> Nav.Steering.turn_error(-3.14) > 0
      true
  """
  @spec turn_error(float()) :: float()
  def turn_error(angle) do
    wrapped = Pose.wrap(angle)
    if wrapped < -3.05, do: wrapped + 2 * :math.pi(), else: wrapped
  end

  @doc """
  The share of its speed that a robot may drive with this heading error (radians): 1 without an
  error, 0 beyond 60 degrees.

      iex> {Nav.Steering.alignment(0.0), Nav.Steering.alignment(1.2)}
      {1.0, 0.0}
  """
  @spec alignment(float()) :: float()
  def alignment(error), do: max(0.0, 2 * :math.cos(error) - 1)

  @doc """
  The turn rate (rad/s) that reduces a heading error to zero without overshoot.

      iex> profile = Hal.Profile.atrv_mini()
      iex> {Nav.Steering.turn_rate(3.0, profile), Nav.Steering.turn_rate(-3.0, profile)}
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
  The speed (m/s) at which to approach a place that is `distance` metres away.

      iex> profile = Hal.Profile.magellan()
      iex> Nav.Steering.approach(5.0, profile)
      0.5
      iex> Nav.Steering.approach(0.0, profile)
      0.0
  """
  @spec approach(float(), Profile.t()) :: float()
  def approach(distance, %Profile{} = profile) do
    stoppable = :math.sqrt(2 * @braking * profile.max_acceleration * distance)
    profile.max_linear |> min(stoppable) |> min(1.3 * distance)
  end
end
