defmodule Sim.Noise do
  @moduledoc """
  Draws random numbers without a generator: a draw is a hash of its purpose (seed, robot, step, index), so it is the
  same in any order, language or process. Pure.

  The factors of the hash have 27 bits, so that Elixir never leaves its small integers.
  """
  import Bitwise

  @mask 0xFFFFFFFF

  @doc """
  A hash of these four numbers: 32 bits.

      iex> Sim.Noise.hash(1, 2, 3, 4) == Sim.Noise.hash(1, 2, 3, 4)
      true
      iex> Sim.Noise.hash(1, 2, 3, 4) == Sim.Noise.hash(1, 2, 3, 5)
      false
  """
  @spec hash(integer(), integer(), integer(), integer()) :: 0..0xFFFFFFFF
  def hash(seed, a, b, c) do
    seed
    |> mix()
    |> bxor(a &&& @mask)
    |> mix()
    |> bxor(b &&& @mask)
    |> mix()
    |> bxor(c &&& @mask)
    |> mix()
  end

  @doc """
  A hash as a number in [0, 1).

      iex> Sim.Noise.unit(0x80000000)
      0.5
  """
  @spec unit(0..0xFFFFFFFF) :: float()
  def unit(hash), do: hash / 4_294_967_296

  @doc """
  A hash as a draw with mean 0 and variance 1, nearly normal and never beyond 3.5, from the sum of
  its four bytes.

      iex> Sim.Noise.gauss(0x7F807F80)
      0.0
  """
  @spec gauss(0..0xFFFFFFFF) :: float()
  def gauss(hash) do
    sum = (hash &&& 255) + (hash >>> 8 &&& 255) + (hash >>> 16 &&& 255) + (hash >>> 24)
    (sum - 510) / 147.8
  end

  @doc """
  A hash as a sign.

      iex> Sim.Noise.sign(0)
      -1.0
  """
  @spec sign(0..0xFFFFFFFF) :: float()
  def sign(hash) when (hash >>> 16 &&& 1) == 1, do: 1.0
  def sign(_hash), do: -1.0

  @doc """
  Another hash, from one that has been drawn for the same purpose.

      iex> Sim.Noise.mix(1) == Sim.Noise.mix(2)
      false
  """
  @spec mix(0..0xFFFFFFFF) :: 0..0xFFFFFFFF
  def mix(x) do
    x = x + 0x9E3779B9 &&& @mask
    x = bxor(x, x >>> 16) * 0x5BD1E95 &&& @mask
    x = bxor(x, x >>> 13) * 0x6C8E9CF &&& @mask
    bxor(x, x >>> 16)
  end
end
