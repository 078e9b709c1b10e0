defmodule Sim.Emulator.RPLidar do
  @moduledoc """
  Emulates a SLAMTEC RPLIDAR at the other end of its serial line, written from the fact sheet alone. Pure: `Sim.Emulator` runs
  it, and its body (`Sim.Device.Scan`), or `Sim.Emulator.see/2`, says what is around it.

  | option | | default |
  |---|---|---|
  | `:turns` | turns a second, 1 to 15 | `5.5` |
  | `:health` | `0` well, `1` a warning, `2` a fault | `0` |
  | `:healed` | whether a reset mends the fault | `true` |
  | `:express` | whether it knows the express scan | `true` |
  | `:seed` | of the small offsets of its angles | `0` |

  Its motor is switched by the command, as that of an A2. What it is asked during a scan it ignores, but for a stop and a reset.
  It measures only while its motor turns.
  """
  @behaviour Sim.Emulator.Core
  import Bitwise
  alias Hal.Options
  alias Sim.Emulator.Spin
  alias Sim.Noise

  @table [
    turns: [{:number, 1, 15, "turns a second"}, default: 5.5],
    health: [{:integer, 0, 2}, default: 0],
    healed: [:boolean, default: true],
    express: [:boolean, default: true],
    seed: [:integer, default: 0]
  ]
  @rates %{standard: 2_000, express: 4_000}
  @boot_ms 1_000

  @enforce_keys [:options, :health, :deaf_ms]
  defstruct @enforce_keys ++
              [
                buffer: <<>>,
                out: [],
                motor?: false,
                mode: nil,
                spin: nil,
                begins?: false,
                around: nil
              ]

  @type t :: %__MODULE__{}

  @impl Sim.Emulator.Core
  def new(options, at_ms) do
    with {:ok, options} <- Options.check(options, @table, "rplidar emulator") do
      options = Map.new(options)
      {:ok, %__MODULE__{options: options, health: options.health, deaf_ms: at_ms}}
    end
  end

  @doc "Whether it measures."
  @spec scans?(t()) :: boolean()
  def scans?(%__MODULE__{spin: spin}), do: spin != nil

  @impl Sim.Emulator.Core
  def restart(core, at_ms),
    do: %{
      core
      | buffer: <<>>,
        out: [],
        motor?: false,
        mode: nil,
        spin: nil,
        deaf_ms: at_ms + @boot_ms
    }

  @impl Sim.Emulator.Core
  def feel(core, {:scan, scan}, _at_ms), do: %{core | around: scan}
  def feel(core, _other, _at_ms), do: core

  @impl Sim.Emulator.Core
  def hear(%{deaf_ms: deaf_ms} = core, _bytes, at_ms) when at_ms < deaf_ms, do: core

  def hear(core, bytes, at_ms),
    do: understand(%{core | buffer: <<>>}, core.buffer <> bytes, at_ms)

  # With bit 7 a command has a payload and a checksum.
  defp understand(core, <<0xA5, cmd, rest::binary>>, at_ms) when cmd < 0x80,
    do: core |> obey(cmd, <<>>, at_ms) |> understand(rest, at_ms)

  defp understand(core, <<0xA5, cmd, size, payload::binary-size(size), sum, rest::binary>>, at_ms) do
    whole? = xor(<<0xA5, cmd, size, payload::binary>>) == sum
    core = if whole?, do: obey(core, cmd, payload, at_ms), else: core
    understand(core, rest, at_ms)
  end

  defp understand(core, <<0xA5, _::binary>> = begun, _at_ms), do: %{core | buffer: begun}
  defp understand(core, <<_odd, rest::binary>>, at_ms), do: understand(core, rest, at_ms)
  defp understand(core, <<>>, _at_ms), do: core

  defp obey(core, 0x25, <<>>, _at_ms), do: %{core | mode: nil, spin: nil}

  defp obey(core, 0x40, <<>>, at_ms) do
    health = if core.options.healed, do: 0, else: core.health
    say(%{restart(core, at_ms) | health: health}, "RP LIDAR System.\r\nFirmware Ver 1.29\r\n")
  end

  defp obey(%{mode: mode} = core, _cmd, _payload, _at_ms) when mode != nil, do: core

  defp obey(core, 0x50, <<>>, _at_ms),
    do:
      say(core, [<<0xA5, 0x5A, 0x14, 0, 0, 0, 4>>, <<18, 29, 1, 7>>, :binary.copy(<<0xC0>>, 16)])

  defp obey(core, 0x52, <<>>, _at_ms),
    do: say(core, <<0xA5, 0x5A, 3, 0, 0, 0, 6, core.health, 7::16-little>>)

  defp obey(core, 0x59, <<>>, _at_ms),
    do: say(core, <<0xA5, 0x5A, 4, 0, 0, 0, 0x15, 500::16-little, 250::16-little>>)

  defp obey(%{health: 2} = core, _scan, _payload, _at_ms), do: core

  defp obey(core, 0x20, <<>>, at_ms),
    do: core |> say(<<0xA5, 0x5A, 5, 0, 0, 0x40, 0x81>>) |> begin(:standard, at_ms)

  defp obey(%{options: %{express: true}} = core, 0x82, <<0::40>>, at_ms),
    do: core |> say(<<0xA5, 0x5A, 0x54, 0, 0, 0x40, 0x82>>) |> begin(:express, at_ms)

  defp obey(core, 0xF0, <<pwm::16-little>>, at_ms), do: turn(%{core | motor?: pwm > 0}, at_ms)
  defp obey(core, _unknown, _payload, _at_ms), do: core

  defp begin(core, mode, at_ms), do: turn(%{core | mode: mode, begins?: true}, at_ms)

  defp turn(%{motor?: true, mode: mode} = core, at_ms) when mode != nil,
    do: %{core | spin: Spin.start(@rates[mode], core.options.turns, at_ms)}

  defp turn(core, _at_ms), do: %{core | spin: nil}

  defp say(core, bytes), do: %{core | out: [core.out, bytes]}

  @impl Sim.Emulator.Core
  def run(core, at_ms) do
    core = if core.spin, do: measure(core, Spin.due(core.spin, size(core), at_ms)), else: core
    {core.out, [], %{core | out: []}}
  end

  defp size(%{mode: :standard}), do: 1
  defp size(%{mode: :express}), do: 32

  defp measure(core, due) when due <= 0, do: core
  defp measure(core, due), do: core |> packet() |> measure(due - 1)

  defp packet(%{mode: :standard, spin: spin} = core) do
    {degrees, first?} = Spin.angle(spin, spin.count)
    mm = Spin.millimetres(core.around, degrees)
    angle = rem(round(degrees * 64), 360 * 64)
    quality = if mm == 0, do: 0, else: 15
    start = if first?, do: 1, else: 2

    bytes =
      <<(quality <<< 2) + start, ((angle &&& 127) <<< 1) + 1, angle >>> 7,
        mm <<< 2 &&& 0xFFFF::16-little>>

    say(%{core | spin: %{spin | count: spin.count + 1}}, bytes)
  end

  defp packet(%{mode: :express, spin: spin} = core) do
    {degrees, _first?} = Spin.angle(spin, spin.count)
    start = rem(round(degrees * 64), 360 * 64)

    points =
      for i <- 0..31 do
        {degrees, _first?} = Spin.angle(spin, spin.count + i)
        offset = Noise.hash(core.options.seed, spin.count, i, 0) &&& 31
        {offset, Spin.millimetres(core.around, degrees - offset / 8)}
      end

    cabins =
      for [{d1, mm1}, {d2, mm2}] <- Enum.chunk_every(points, 2), into: <<>> do
        <<(mm1 <<< 2) + (d1 >>> 4) &&& 0xFFFF::16-little,
          (mm2 <<< 2) + (d2 >>> 4) &&& 0xFFFF::16-little, ((d2 &&& 15) <<< 4) + (d1 &&& 15)>>
      end

    first = if core.begins?, do: 0x8000, else: 0
    body = <<start + first::16-little, cabins::binary>>
    sum = xor(body)
    bytes = [<<0xA0 + (sum &&& 15), 0x50 + (sum >>> 4)>>, body]
    say(%{core | begins?: false, spin: %{spin | count: spin.count + 32}}, bytes)
  end

  @impl Sim.Emulator.Core
  def next_ms(%{spin: nil}), do: nil
  def next_ms(core), do: Spin.next_ms(core.spin, size(core))

  defp xor(bytes), do: for(<<byte <- bytes>>, reduce: 0, do: (sum -> bxor(sum, byte)))
end
