defmodule Sim.Emulator.Create do
  @moduledoc """
  Emulates an iRobot Create 2 (or a Roomba 600 to 800) at the other end of the serial line, written from the fact sheet alone. Pure;
  `Sim.Emulator` runs it.

  | option | allowed | meaning |
  |---|---|---|
  | `:counters` | `{left, right}`, 0 to 0xFFFF | where its encoders begin (`{0xFF00, 0xFF00}`, so that they soon wrap) |
  | `:acceleration` | m/s2 | of its wheels (2.0): the sheet has none |
  | `:millivolts` | 0 to 0xFFFF | of its battery (15_500) |
  | `:boot_ms` | ms | how long it hears nothing after it was switched on (0) or reset (this, and 5_000 more) |

  It takes bytes one by one: a byte that is lost makes it take the next ones for something else. After a change of its mode it hears
  nothing for 20 ms. In the safe mode it goes passive, and its wheels stand, at a cliff under way, with a wheel in the air and on a
  charger. After 5 minutes in the passive mode without a command it sleeps, and hears nothing until it is switched off and on. **It
  has no time-out.** Where the sheet leaves it open: an opcode that it does not know is passed over.
  """
  use Sim.Emulator.Wheels
  alias Hal.Options
  alias Sim.Emulator.Create.Sensors
  alias Sim.Emulator.Wheels

  @base 0.235
  @most 0.5
  @settle_ms 20
  @stream_ms 15
  @sleep_ms 300_000
  @reset_ms 5_000

  @passive 1
  @safe 2
  @full 3

  @word {:integer, 0, 0xFFFF}
  @table [
    counters: [{:tuple, [@word, @word], "{left, right}, 0 to 65535,"}, default: {0xFF00, 0xFF00}],
    acceleration: [{:number, 0.01, 100, "m/s2"}, default: 2.0],
    millivolts: [@word, default: 15_500],
    boot_ms: [{:integer, 0, 60_000, "ms"}, default: 0]
  ]

  # How many bytes follow an opcode; of the others the first byte that follows says how many.
  @sizes %{
    7 => 0,
    128 => 0,
    129 => 1,
    131 => 0,
    132 => 0,
    133 => 0,
    134 => 0,
    135 => 0,
    136 => 0,
    137 => 4,
    138 => 1,
    139 => 3,
    141 => 1,
    142 => 1,
    143 => 0,
    144 => 3,
    145 => 4,
    146 => 4,
    150 => 1,
    164 => 4,
    173 => 0
  }

  @enforce_keys [:options, :wheels, :deaf_ms, :heard_ms]
  defstruct @enforce_keys ++
              [
                mode: 0,
                open: <<>>,
                out: [],
                stream: [],
                stream_ms: nil,
                read: {0.0, 0.0},
                bumps: 0,
                drops: 0,
                cliffs: 0,
                charger: 0,
                overcurrent: 0,
                counts: %{commands: 0, unknown: 0, deaf: 0}
              ]

  @typedoc "`open` is a command whose bytes have not all come; `read` where the wheels were when way and turn were last asked."
  @type t :: %__MODULE__{}

  @impl Sim.Emulator.Core
  def new(options, at_ms) do
    with {:ok, options} <- Options.check(options, @table, "create emulator") do
      options = Map.new(options)
      wheels = Wheels.new(@base, options.acceleration, at_ms)
      deaf_ms = at_ms + options.boot_ms
      {:ok, %__MODULE__{options: options, wheels: wheels, deaf_ms: deaf_ms, heard_ms: at_ms}}
    end
  end

  @impl Sim.Emulator.Core
  def restart(%__MODULE__{} = core, at_ms) do
    boot = super(core, at_ms)
    %{boot | out: ["bl-start\r\n2012-12-17\r\nRoomba by iRobot!\r\n"], cliffs: core.cliffs}
  end

  @doc "From now on this is so: `bumps` and `drops` (the bits of packet 7), `cliffs` (1 right to 8 left), `charger` (packet 34), `overcurrent` (packet 14)."
  @spec set(t(), :bumps | :drops | :cliffs | :charger | :overcurrent, byte()) :: t()
  def set(%__MODULE__{} = core, what, bits)
      when what in [:bumps, :drops, :cliffs, :charger, :overcurrent],
      do: Map.replace!(core, what, bits)

  @impl Sim.Emulator.Core
  def hear(%__MODULE__{} = core, bytes, at_ms),
    do:
      for(<<byte <- bytes>>, reduce: advance(core, at_ms), do: (core -> byte(core, byte, at_ms)))

  defp byte(%{deaf_ms: deaf_ms} = core, _byte, at_ms) when at_ms < deaf_ms,
    do: count(core, :deaf)

  defp byte(%{mode: :asleep} = core, _byte, _at_ms), do: count(core, :deaf)
  defp byte(core, byte, at_ms), do: complete(%{core | open: core.open <> <<byte>>}, at_ms)

  defp complete(%{open: <<opcode, data::binary>>} = core, at_ms) do
    case size(opcode, data) do
      size when byte_size(data) == size ->
        command(count(%{core | open: <<>>, heard_ms: at_ms}, :commands), opcode, data, at_ms)

      nil ->
        count(%{core | open: <<>>}, :unknown)

      _more_to_come ->
        core
    end
  end

  # Lists of packets, and songs.
  defp size(opcode, <<>>) when opcode in [140, 148, 149], do: 1
  defp size(opcode, <<n, _::binary>>) when opcode in [148, 149], do: 1 + n
  defp size(140, <<_number>>), do: 2
  defp size(140, <<_number, n, _::binary>>), do: 2 + 2 * n
  defp size(opcode, _data), do: @sizes[opcode]

  defp command(core, 128, <<>>, at_ms), do: mode(core, @passive, at_ms)
  # Off, it knows nothing else.
  defp command(%{mode: 0} = core, _opcode, _data, _at_ms), do: core
  defp command(core, 131, <<>>, at_ms), do: mode(core, @safe, at_ms)
  defp command(core, 132, <<>>, at_ms), do: mode(core, @full, at_ms)

  defp command(core, op, <<>>, at_ms) when op in [133, 173],
    do: mode(%{core | stream_ms: nil}, 0, at_ms)

  defp command(core, op, <<>>, at_ms) when op in [134, 135, 136, 143],
    do: mode(core, @passive, at_ms)

  defp command(core, 7, <<>>, at_ms) do
    booting = restart(core, at_ms)
    %{booting | deaf_ms: booting.deaf_ms + @reset_ms}
  end

  defp command(core, 142, <<id>>, _at_ms), do: tell(core, [id])
  defp command(core, 149, <<_n, ids::binary>>, _at_ms), do: tell(core, :binary.bin_to_list(ids))

  defp command(core, 148, <<_n, ids::binary>>, at_ms),
    do: %{core | stream: :binary.bin_to_list(ids), stream_ms: at_ms + @stream_ms}

  defp command(core, 150, <<on>>, at_ms),
    do: %{core | stream_ms: if(on == 1 and core.stream != [], do: at_ms + @stream_ms)}

  defp command(%{mode: mode} = core, 145, <<right::signed-16, left::signed-16>>, at_ms)
       when mode in [@safe, @full],
       do: drive(core, {left / 1_000, right / 1_000}, at_ms)

  defp command(%{mode: mode} = core, 137, <<speed::signed-16, radius::signed-16>>, at_ms)
       when mode in [@safe, @full],
       do: drive(core, bend(speed / 1_000, radius), at_ms)

  defp command(core, _opcode, _data, _at_ms), do: core

  # Radius in mm of the robot's centre, left positive.
  defp bend(speed, radius) when radius in [-0x8000, 0x7FFF], do: {speed, speed}
  defp bend(speed, 1), do: {-speed, speed}
  defp bend(speed, -1), do: {speed, -speed}

  defp bend(speed, radius) do
    half = 1_000 * @base / 2
    {speed * (radius - half) / radius, speed * (radius + half) / radius}
  end

  defp mode(core, mode, at_ms) do
    core = %{core | mode: mode, deaf_ms: at_ms + @settle_ms}
    if mode in [@safe, @full], do: core, else: drive(core, {0, 0}, at_ms)
  end

  defp drive(core, {left, right}, at_ms) do
    speeds = {left |> max(-@most) |> min(@most), right |> max(-@most) |> min(@most)}
    %{core | wheels: Wheels.tell(core.wheels, speeds, at_ms)}
  end

  defp tell(core, ids) do
    %{core | out: [core.out, Sensors.data(core, ids)], read: core.wheels.gone}
  end

  defp count(core, what), do: update_in(core.counts[what], &(&1 + 1))

  @impl Sim.Emulator.Core
  def wheels(%__MODULE__{} = core, at_ms), do: advance(core, at_ms).wheels |> Wheels.twist()

  # Its safety is judged as often as it would report, asked or not.
  @impl Sim.Emulator.Core
  def next_ms(%__MODULE__{} = core), do: core.stream_ms || core.wheels.at_ms + @stream_ms

  @impl Sim.Emulator.Core
  def run(%__MODULE__{} = core, at_ms) do
    core = core |> advance(at_ms) |> guard(at_ms) |> doze(at_ms) |> report(at_ms)
    {wishes, wheels} = Wheels.wishes(core.wheels, at_ms)
    {core.out, wishes, %{core | out: [], wheels: wheels}}
  end

  defp advance(core, at_ms), do: %{core | wheels: Wheels.advance(core.wheels, at_ms)}

  defp guard(%{mode: @safe} = core, at_ms) do
    {left, right} = core.wheels.told
    # A cliff counts forward, and backward in a tight bend.
    moves? = left > 0 or right > 0
    danger? = core.drops != 0 or core.charger != 0 or (core.cliffs != 0 and moves?)
    if danger?, do: mode(core, @passive, at_ms), else: core
  end

  defp guard(core, _at_ms), do: core

  defp doze(%{mode: @passive, heard_ms: heard_ms} = core, at_ms)
       when at_ms - heard_ms >= @sleep_ms,
       do: %{core | mode: :asleep, stream_ms: nil}

  defp doze(core, _at_ms), do: core

  # After a delay it does not make up for the frames it missed.
  defp report(%{stream_ms: due_ms} = core, at_ms) when due_ms != nil and due_ms <= at_ms do
    body = for id <- core.stream, into: <<>>, do: <<id, Sensors.data(core, [id])::binary>>
    frame = <<19, byte_size(body), body::binary>>
    sum = for <<byte <- frame>>, reduce: 0, do: (sum -> sum + byte)
    next_ms = max(due_ms + @stream_ms, at_ms + 1)
    %{core | out: [core.out, frame, <<-sum::8>>], stream_ms: next_ms, read: core.wheels.gone}
  end

  defp report(core, _at_ms), do: core
end
