defmodule Hal.RFlex.Sensors.Bumpers do
  @moduledoc """
  Reads which segments of the body are pressed, from the digital inputs. Pure.

    * style `:bit` - each bit of an address is a bumper, such as the Magellan Pro's 16 at 0x40 and
      0x41
    * style `:address` - each address is a panel, whose lower four bits are its switches, as on
      the B21r

  `segments` says for each bumper which of the 16 segments it is, counted counter-clockwise from
  the front. No source says where a Magellan's bumpers are; by default they are assumed to lie
  like its sonars: the first at the rear right, the others clockwise from it.
  """
  import Bitwise

  @enforce_keys [:style, :base, :count, :segments]
  defstruct @enforce_keys ++ [states: %{}]

  @type t :: %__MODULE__{
          style: :bit | :address,
          base: byte(),
          count: non_neg_integer(),
          segments: [0..15],
          states: %{byte() => byte()}
        }

  @doc """
  The segments of the bumpers, unless configured.

      iex> Enum.take(Hal.RFlex.Sensors.Bumpers.default_segments(:bit, 16), 3)
      [11, 10, 9]
      iex> Hal.RFlex.Sensors.Bumpers.default_segments(:address, 4)
      [0, 4, 8, 12]
  """
  @spec default_segments(:bit | :address, non_neg_integer()) :: [0..15]
  def default_segments(:bit, count),
    do: for(k <- 0..(count - 1)//1, do: Integer.mod(11 - k, 16))

  def default_segments(:address, count),
    do: for(k <- 0..(count - 1)//1, do: div(16 * k, count))

  @doc "Takes an input report; `:other` if the address is not that of a bumper."
  @spec report(t(), byte(), byte()) :: {:ok, t()} | :other
  def report(%__MODULE__{base: base} = bumpers, address, state) do
    if address >= base and address < base + addresses(bumpers),
      do: {:ok, %{bumpers | states: Map.put(bumpers.states, address, state)}},
      else: :other
  end

  @doc """
  The pressed segments, in ascending order.

      iex> alias Hal.RFlex.Sensors.Bumpers
      iex> bumpers = %Bumpers{style: :bit, base: 0x40, count: 16, segments: Enum.to_list(0..15)}
      iex> {:ok, bumpers} = Bumpers.report(bumpers, 0x41, 0x80)
      iex> Bumpers.pressed(bumpers)
      [15]
  """
  @spec pressed(t()) :: [0..15]
  def pressed(%__MODULE__{} = bumpers) do
    pressed =
      for {segment, k} <- Enum.with_index(bumpers.segments), down?(bumpers, k), do: segment

    pressed |> Enum.uniq() |> Enum.sort()
  end

  defp down?(%{style: :bit} = bumpers, k),
    do: band(state(bumpers, div(k, 8)), 1 <<< rem(k, 8)) != 0

  defp down?(%{style: :address} = bumpers, k), do: band(state(bumpers, k), 0x0F) != 0

  defp state(bumpers, offset), do: Map.get(bumpers.states, bumpers.base + offset, 0)

  defp addresses(%{style: :bit, count: count}), do: div(count + 7, 8)
  defp addresses(%{style: :address, count: count}), do: count
end
