defmodule Sim.Emulator.RFlexController.Senses do
  @moduledoc false
  # Converts what the body senses to the numbers of a controller's boards: bumpers as digital
  # inputs, infrared as bytes of a converter (fact sheet rFLEX, sections 6, 7 and 12). Pure.

  @doc """
  The states of the digital inputs by address, for pressed segments counted counter-clockwise from
  the front.

  The sheet does not give the places of bumpers and proposes those of the sonars: number 11 in
  front, clockwise.

      iex> {:ok, options} = Sim.Emulator.RFlexController.Options.check([])
      iex> Sim.Emulator.RFlexController.Senses.inputs([0, 9], options)
      %{0x40 => 0b00000100, 0x41 => 0b00001000}
  """
  @spec inputs([0..15], map()) :: %{byte() => byte()}
  def inputs(pressed, %{bumpers: count} = options) when count > 0 do
    numbers =
      for segment <- pressed, uniq: true, do: div(Integer.mod(11 - segment, 16) * count, 16)

    case options.bumper_style do
      :bit ->
        for board <- 0..div(count - 1, 8), into: %{} do
          bits = for n <- numbers, div(n, 8) == board, do: Bitwise.bsl(1, rem(n, 8))
          {options.bumper_base + board, Enum.reduce(bits, 0, &Bitwise.bor/2)}
        end

      :address ->
        Map.new(0..(count - 1), fn n ->
          {options.bumper_base + n, if(n in numbers, do: 1, else: 0)}
        end)
    end
  end

  def inputs(_pressed, _no_bumpers), do: %{}

  @doc """
  The bytes of the infrared boards, for the body's ranges in metres: the byte nearest to the V of
  range = a V^b.

      iex> {:ok, options} = Sim.Emulator.RFlexController.Options.check([])
      iex> [first, _second] = Sim.Emulator.RFlexController.Senses.infrared(List.duplicate(0.4, 16), options)
      iex> first
      [100, 100, 100, 100, 100, 100, 100, 100]
  """
  @spec infrared([float()], map()) :: [[byte()]]
  def infrared(ranges, options) do
    ranges = List.to_tuple(ranges)

    values =
      for place <- options.ir_wiring, place < tuple_size(ranges) do
        volts(elem(ranges, place), options)
      end

    {boards, _rest} = Enum.map_reduce(options.ir_banks, values, &Enum.split(&2, &1))
    boards
  end

  # If nothing is near, it returns the value for something at 1.5 times the maximum range.
  defp volts(range, %{conversions: conversions, ir_max: ir_max}) do
    range = if range >= ir_max, do: 1.5 * ir_max, else: max(range, 0.01)
    round(:math.pow(range / conversions[:ir_a], 1 / conversions[:ir_b])) |> max(0) |> min(255)
  end
end
