defmodule Robot.Localiser.Belief do
  @moduledoc """
  A pose and how sure one is of it: an extended Kalman filter over (x, y, heading), moved by
  odometry and corrected by one scalar measurement after another. Pure.

  The covariance is `{xx, xy, xh, yy, yh, hh}`. Formulas: Siegwart and Nourbakhsh 2004 for odometry,
  the standard filter else.
  """
  alias Hal.Pose

  @start_sd {0.03, 0.03, 0.02}
  # Standard deviations of odometry: of the way driven, of the angle turned (skid steering slips by
  # 5 % and more, R74), of angle per metre.
  @way_share 0.01
  @turn_share 0.06
  @turn_per_metre 0.01
  # What is farther off than three standard deviations is not believed.
  @gate 9.0
  # Where measurements go on contradicting the estimate, it is the estimate that is doubted: a
  # refusal counts two, one that is believed takes one back.
  @doubt 16
  @doubt_sd {0.3, 0.3, 0.3}

  @enforce_keys [:pose, :covariance]
  defstruct @enforce_keys ++ [refused: 0]

  @type t :: %__MODULE__{
          pose: Pose.t(),
          covariance: {float(), float(), float(), float(), float(), float()},
          refused: non_neg_integer()
        }

  @doc "A robot that was put down at a pose by hand."
  @spec new(Pose.t()) :: t()
  def new(%Pose{} = pose) do
    {x, y, heading} = @start_sd
    %__MODULE__{pose: pose, covariance: {x * x, 0.0, 0.0, y * y, 0.0, heading * heading}}
  end

  @doc """
  Moved by a step of odometry, given in the robot's own frame.

      iex> belief = Robot.Localiser.Belief.new(Hal.Pose.new(1, 0))
      iex> Robot.Localiser.Belief.move(belief, Hal.Pose.new(0.5, 0)).pose
      Hal.Pose.new(1.5, 0)
  """
  @spec move(t(), step :: Pose.t()) :: t()
  def move(belief, step) do
    pose = Pose.compose(belief.pose, step)
    way = :math.sqrt(step.x * step.x + step.y * step.y)
    # With d the way and h the heading half-way, F = [1 0 -d sin h; 0 1 d cos h; 0 0 1].
    a = -(pose.y - belief.pose.y)
    b = pose.x - belief.pose.x
    {xx, xy, xh, yy, yh, hh} = belief.covariance
    along = :math.pow(@way_share * way, 2)
    turned = :math.pow(@turn_share * abs(step.heading), 2) + :math.pow(@turn_per_metre * way, 2)

    covariance = {
      xx + 2 * a * xh + a * a * hh + along,
      xy + a * yh + b * xh + a * b * hh,
      xh + a * hh,
      yy + 2 * b * yh + b * b * hh + along,
      yh + b * hh,
      hh + turned
    }

    %{belief | pose: pose, covariance: covariance}
  end

  @doc """
  Corrected by one measurement: its `error` (measured minus expected), how the expected value
  changes with x, y and heading, and the variance of its noise. K = P H' / S, x + K e, (1 - K H) P.
  """
  @spec correct(t(), float(), {float(), float(), float()}, float()) :: t()
  def correct(belief, error, {a, b, c}, noise) do
    {xx, xy, xh, yy, yh, hh} = belief.covariance
    px = xx * a + xy * b + xh * c
    py = xy * a + yy * b + yh * c
    ph = xh * a + yh * b + hh * c
    s = a * px + b * py + c * ph + noise

    if error * error > @gate * s do
      refuse(belief)
    else
      {kx, ky, kh} = {px / s, py / s, ph / s}
      pose = belief.pose

      %__MODULE__{
        pose: Pose.new(pose.x + kx * error, pose.y + ky * error, pose.heading + kh * error),
        covariance: {
          xx - kx * px,
          xy - kx * py,
          xh - kx * ph,
          yy - ky * py,
          yh - ky * ph,
          hh - kh * ph
        },
        refused: max(belief.refused - 1, 0)
      }
    end
  end

  # Wheels that slip take the estimate farther than odometry admits; then it has to be found again.
  defp refuse(%{refused: refused} = belief) when refused < @doubt,
    do: %{belief | refused: refused + 2}

  defp refuse(belief), do: doubt(belief)

  @doc "The same pose, of which one is less sure by decimetres: something happened that nobody measured."
  @spec doubt(t()) :: t()
  def doubt(%__MODULE__{} = belief) do
    {xx, xy, xh, yy, yh, hh} = belief.covariance
    {x, y, heading} = @doubt_sd

    %{
      belief
      | refused: 0,
        covariance: {xx + x * x, xy, xh, yy + y * y, yh, hh + heading * heading}
    }
  end
end
