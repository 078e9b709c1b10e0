defmodule Hal.Twist do
  @moduledoc """
  Holds the speed of a body in the plane: `linear` in m/s, forward positive; `turn` in rad/s, left positive. Pure.
  """

  @enforce_keys [:linear, :turn]
  defstruct @enforce_keys

  @type t :: %__MODULE__{linear: float(), turn: float()}

  @doc """
  A twist from numbers.

      iex> Hal.Twist.new(1, 0)
      %Hal.Twist{linear: 1.0, turn: 0.0}
  """
  @spec new(number(), number()) :: t()
  def new(linear, turn), do: %__MODULE__{linear: linear * 1.0, turn: turn * 1.0}

  @doc "A speed of zero."
  @spec zero() :: t()
  def zero, do: %__MODULE__{linear: 0.0, turn: 0.0}

  @doc """
  Whether both speeds are zero.

      iex> Hal.Twist.zero?(Hal.Twist.new(0, 0.1))
      false
  """
  @spec zero?(t()) :: boolean()
  def zero?(%__MODULE__{linear: linear, turn: turn}), do: linear == 0.0 and turn == 0.0
end
