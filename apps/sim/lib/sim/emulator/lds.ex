defmodule Sim.Emulator.Lds do
  @moduledoc """
  Emulates the lidar of a TurtleBot3 at the other end of its serial line, an LDS-01 or an LDS-02, written from what is published of
  their packets. Pure: `Sim.Emulator` runs it, and its body (`Sim.Device.Scan`), or `Sim.Emulator.see/2`, says what is around it.

  Options: `:model`, `:lds01` (the default), which turns from `b` to `e`, five times a second with a measurement each degree;
  or `:lds02`, which turns as long as it has power, and measures 2300 times a second.
  """
  @behaviour Sim.Emulator.Core
  import Bitwise
  alias Hal.Options
  alias Sim.Emulator.Spin

  @table [model: [{:one_of, [:lds01, :lds02]}, default: :lds01]]
  @models %{lds01: {1_800, 5.0, 6}, lds02: {2_300, 5.0, 12}}

  @enforce_keys [:model]
  defstruct @enforce_keys ++ [spin: nil, around: nil]

  @type t :: %__MODULE__{}

  @impl Sim.Emulator.Core
  def new(options, at_ms) do
    with {:ok, options} <- Options.check(options, @table, "lds emulator"),
         do: {:ok, restart(%__MODULE__{model: options[:model]}, at_ms)}
  end

  @doc "Whether it measures."
  @spec scans?(t()) :: boolean()
  def scans?(%__MODULE__{spin: spin}), do: spin != nil

  @impl Sim.Emulator.Core
  def restart(%{model: :lds01} = core, _at_ms), do: %{core | spin: nil}
  def restart(core, at_ms), do: turn(core, at_ms)

  defp turn(core, at_ms) do
    {per_s, turns, _size} = @models[core.model]
    %{core | spin: Spin.start(per_s, turns, at_ms)}
  end

  @impl Sim.Emulator.Core
  def feel(core, {:scan, scan}, _at_ms), do: %{core | around: scan}
  def feel(core, _other, _at_ms), do: core

  @impl Sim.Emulator.Core
  def hear(%{model: :lds02} = core, _bytes, _at_ms), do: core

  def hear(core, bytes, at_ms) do
    for <<byte <- bytes>>, reduce: core do
      core when byte == ?b and core.spin == nil -> turn(core, at_ms)
      core when byte == ?e -> %{core | spin: nil}
      core -> core
    end
  end

  @impl Sim.Emulator.Core
  def run(%{spin: nil} = core, _at_ms), do: {[], [], core}
  def run(core, at_ms), do: packets(core, Spin.due(core.spin, size(core), at_ms), [])

  defp size(%{model: model}), do: elem(@models[model], 2)

  defp packets(core, due, out) when due <= 0, do: {out, [], core}

  defp packets(%{spin: spin} = core, due, out) do
    size = size(core)

    points =
      for n <- spin.count..(spin.count + size - 1) do
        {degrees, _first?} = Spin.angle(spin, n)
        {degrees, Spin.millimetres(core.around, degrees)}
      end

    core = %{core | spin: %{spin | count: spin.count + size}}
    packets(core, due - 1, [out, packet(core.model, points)])
  end

  defp packet(:lds01, [{first, _mm} | _] = points) do
    readings =
      for {_degrees, mm} <- points, into: <<>>, do: <<200::16-little, mm::16-little, 0::16>>

    # 300 turns a minute.
    bytes = <<0xFA, 0xA0 + rem(round(first / 6), 60), 3_000::16-little, readings::binary>>
    sum = 255 - rem(Enum.sum(:binary.bin_to_list(bytes)), 256)
    [bytes, sum, sum]
  end

  defp packet(:lds02, [{first, _mm} | _] = points) do
    {last, _mm} = List.last(points)
    readings = for {_degrees, mm} <- points, into: <<>>, do: <<mm::16-little, 200>>

    bytes =
      <<0x54, 0x2C, 1_800::16-little, hundredths(first)::16-little, readings::binary,
        hundredths(last)::16-little, 0::16>>

    [bytes, crc(bytes, 0)]
  end

  defp hundredths(degrees), do: rem(round(degrees * 100), 36_000)

  @impl Sim.Emulator.Core
  def next_ms(%{spin: nil}), do: nil
  def next_ms(core), do: Spin.next_ms(core.spin, size(core))

  # Of the polynomial x^8 + x^6 + x^3 + x^2 + 1, the highest bit first.
  defp crc(<<bit::1, rest::bitstring>>, crc) do
    top = crc >>> 7
    crc = crc <<< 1 &&& 255
    crc(rest, if(bxor(top, bit) == 1, do: bxor(crc, 0x4D), else: crc))
  end

  defp crc(<<>>, crc), do: crc
end
