defmodule Robot.Wish do
  @moduledoc """
  Describes what a behaviour proposes for the next tick: a speed, its weight (0 to 1), and optionally where
  the camera should look (`look`, pan in radians, left positive).

  A behaviour that wants to reach a place also gives the desired planar `velocity` (map frame,
  m/s) and the place (`goal`), so that `Robot.Behaviour.Avoid` can change the velocity to avoid
  others before it is converted to a speed of the wheels. Without a velocity the wish is only
  slowed down. `reverse?` allows driving backwards.

  `by` names the behaviour, so that the robot's status can report the reason for its motion.
  """
  alias Hal.Twist

  @enforce_keys [:by, :twist, :weight]
  defstruct @enforce_keys ++ [look: nil, velocity: nil, goal: nil, reverse?: false]

  @type t :: %__MODULE__{
          by: atom(),
          twist: Twist.t(),
          weight: float(),
          look: float() | nil,
          velocity: {vx :: float(), vy :: float()} | nil,
          goal: {x :: float(), y :: float()} | nil,
          reverse?: boolean()
        }

  @doc """
  A wish; the optional fields are given by name.

      iex> Robot.Wish.new(:stop, Hal.Twist.zero(), 0.1).weight
      0.1
      iex> Robot.Wish.new(:goto, Hal.Twist.zero(), 0.5, velocity: {0.3, 0.0}).velocity
      {0.3, 0.0}
  """
  @spec new(atom(), Twist.t(), number(), keyword()) :: t()
  def new(by, %Twist{} = twist, weight, fields \\ []) when weight >= 0 and weight <= 1,
    do: struct!(%__MODULE__{by: by, twist: twist, weight: weight * 1.0}, fields)
end
