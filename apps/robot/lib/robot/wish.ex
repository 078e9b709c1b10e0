defmodule Robot.Wish do
  @moduledoc """
  What a behaviour proposes for the next tick: a speed, how much it matters (0 to 1), and,
  if it cares, where the camera should look (`look`, pan in radians, left positive).

  `by` names the behaviour, so that a person can ask why a robot did what it did.
  """
  alias Hal.Twist

  @enforce_keys [:by, :twist, :weight]
  defstruct @enforce_keys ++ [look: nil]

  @type t :: %__MODULE__{
          by: atom(),
          twist: Twist.t(),
          weight: float(),
          look: float() | nil
        }

  @doc """
  A wish.

      iex> Robot.Wish.new(:stop, Hal.Twist.zero(), 0.1).weight
      0.1
  """
  @spec new(atom(), Twist.t(), float()) :: t()
  def new(by, %Twist{} = twist, weight) when weight >= 0 and weight <= 1,
    do: %__MODULE__{by: by, twist: twist, weight: weight * 1.0}
end
