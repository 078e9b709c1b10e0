defmodule Hal.RFlex.Sensors.Infrared do
  @moduledoc false
  # Computes the ranges of the infrareds from their voltages (a byte each). Pure.
  #
  # Two laws are in use, with constants that differ from sensor to sensor:
  #
  #   * `:metres` - range = a · V^b, in metres; a = 4000, b = -2 is an example
  #   * `:millimetres` - range = (a · V)^b, in millimetres; a = 0.0005456, b = -2.086 is an example
  #
  # Below the least range the sensor does not show how near something is: the range is 0. Above the
  # greatest, and at a voltage of 0, it is the greatest.
  #
  # A report has the sensors in the order of their boards, a profile in that of its poses: `order`
  # gives for each pose the place in the report. The boards of a Magellan Pro's infrareds follow
  # another order than those of its sonars.

  @enforce_keys [:banks, :base, :order, :laws, :law, :least, :greatest]
  defstruct @enforce_keys

  @type t :: %__MODULE__{
          banks: [0..8],
          base: non_neg_integer(),
          order: [non_neg_integer()],
          laws: [{a :: float(), b :: float()}],
          law: :metres | :millimetres,
          least: float(),
          greatest: float()
        }

  @doc "The order of a Magellan Pro's 16 infrareds."
  @spec magellan_order() :: [0..15]
  def magellan_order, do: Enum.to_list(0..7) ++ Enum.to_list(12..15) ++ Enum.to_list(8..11)

  @doc """
  The ranges in metres; `nil` if the report lacks a bank.

      iex> alias Hal.RFlex.Sensors.Infrared
      iex> infrared = %Infrared{banks: [2], base: 0, order: [1, 0], laws: [{4000.0, -2.0}, {4000.0, -2.0}],
      ...>   law: :metres, least: 0.1, greatest: 0.8}
      iex> Infrared.ranges(infrared, [<<100, 200, 0, 0, 0, 0, 0, 0>>])
      [0.1, 0.4]
  """
  @spec ranges(t(), [<<_::64>>]) :: [float()] | nil
  def ranges(%__MODULE__{} = infrared, banks) do
    fitted = Enum.drop(banks, infrared.base)

    if length(fitted) >= length(infrared.banks) do
      voltages =
        for {bytes, n} <- Enum.zip(fitted, infrared.banks),
            k <- 0..(n - 1)//1,
            do: :binary.at(bytes, k)

      ranges =
        voltages |> Enum.zip(infrared.laws) |> Enum.map(&range(&1, infrared)) |> List.to_tuple()

      for place <- infrared.order, do: elem(ranges, place)
    end
  end

  defp range({0, _law}, infrared), do: infrared.greatest

  defp range({voltage, {a, b}}, infrared) do
    metres =
      case infrared.law do
        :metres -> a * :math.pow(voltage, b)
        :millimetres -> :math.pow(a * voltage, b) / 1000
      end

    cond do
      metres < infrared.least - 1.0e-9 -> 0.0
      metres > infrared.greatest -> infrared.greatest
      true -> metres
    end
  end
end
