defmodule Sim.Emulator.TurtleBot3 do
  @moduledoc """
  Emulates the OpenCR board of a TurtleBot3 with its firmware for ROS 2, written from the fact sheet alone: a Dynamixel slave with a
  control table. Pure; `Sim.Emulator` runs it.

  | option | allowed | meaning |
  |---|---|---|
  | `:model` | `:burger`, `:waffle` | the distance of its wheels (`:burger`) |
  | `:counters` | `{left, right}`, signed 32 bits | where its encoders begin (`{2_147_483_000, -300}`: the left one soon wraps) |
  | `:clock` | 0 to 0xFFFFFFFF | where its clock begins (1000) |
  | `:acceleration` | m/s2 | of its wheels (2.0): the sheet has none |
  | `:centivolts` | whole number | of its battery (1190) |
  | `:motors` | `true`, `false` | whether they are connected (`true`) |

  **A heartbeat that has been missing for 500 ms zeroes the velocity**; what is written before the first one is zeroed, too. Without torque
  the wheels stand. Where the sheet leaves it open: an address that cannot be written is error 7, an unknown instruction error 2.
  """
  use Sim.Emulator.Wheels
  alias Hal.Options
  alias Sim.Emulator.Wheels
  import Bitwise

  @id 200
  @beat_ms 500
  @radius 0.033
  @ticks 4096
  @bases %{burger: 0.160, waffle: 0.287}
  @still_ms 5_000
  @longest 256
  @period_ms 20

  @word {:integer, -0x8000_0000, 0x7FFF_FFFF}
  @table [
    model: [{:one_of, [:burger, :waffle]}, default: :burger],
    counters: [
      {:tuple, [@word, @word], "{left, right}, signed 32 bits,"},
      default: {2_147_483_000, -300}
    ],
    clock: [{:integer, 0, 0xFFFF_FFFF}, default: 1_000],
    acceleration: [{:number, 0.01, 100, "m/s2"}, default: 2.0],
    centivolts: [{:integer, 0, 10_000}, default: 1_190],
    motors: [:boolean, default: true]
  ]

  @enforce_keys [:options, :wheels, :booted_ms]
  defstruct @enforce_keys ++
              [
                buffer: <<>>,
                out: [],
                beat_ms: nil,
                torque?: false,
                still_ms: nil,
                disturbed?: false,
                counts: %{frames: 0, bad: 0, beats: 0}
              ]

  @type t :: %__MODULE__{}

  @impl Sim.Emulator.Core
  def new(options, at_ms) do
    with {:ok, options} <- Options.check(options, @table, "turtlebot3 emulator") do
      wheels = Wheels.new(@bases[options[:model]], options[:acceleration], at_ms)
      {:ok, %__MODULE__{options: Map.new(options), wheels: wheels, booted_ms: at_ms}}
    end
  end

  @impl Sim.Emulator.Core
  def hear(%__MODULE__{} = core, bytes, at_ms) do
    core = advance(core, at_ms)
    {frames, rest, bad} = cut(core.buffer <> bytes, [], 0)

    counts = %{
      core.counts
      | frames: core.counts.frames + length(frames),
        bad: core.counts.bad + bad
    }

    Enum.reduce(frames, %{core | buffer: rest, counts: counts}, &obey(&2, &1, at_ms))
  end

  # Start, id, length of all that follows, instruction, parameters, CRC.
  defp cut(<<0xFF, 0xFF, 0xFD, 0, id, size::little-16, rest::binary>> = bytes, found, bad)
       when size in 3..@longest do
    inside = size - 2

    case rest do
      <<body::binary-size(inside), crc::little-16, later::binary>> ->
        if crc == crc(<<0xFF, 0xFF, 0xFD, 0, id, size::little-16, body::binary>>),
          do: cut(later, [{id, plain(body)} | found], bad),
          else: cut(rest, found, bad + 1)

      _unfinished ->
        {Enum.reverse(found), bytes, bad}
    end
  end

  defp cut(bytes, found, bad) when byte_size(bytes) < 7, do: {Enum.reverse(found), bytes, bad}
  defp cut(<<_noise, rest::binary>>, found, bad), do: cut(rest, found, bad)

  defp plain(body),
    do: :binary.replace(body, <<0xFF, 0xFF, 0xFD, 0xFD>>, <<0xFF, 0xFF, 0xFD>>, [:global])

  # Bit by bit: polynomial 8005, highest bit first.
  defp crc(bytes) do
    for <<bit::1 <- bytes>>, reduce: 0 do
      crc when crc >>> 15 == bit -> crc <<< 1 &&& 0xFFFF
      crc -> bxor(crc <<< 1 &&& 0xFFFF, 0x8005)
    end
  end

  # Ping, read, write; frames for others are not its business.
  defp obey(core, {@id, <<1>>}, _at_ms), do: reply(core, 0, <<0x10, 0x40, 1>>)

  defp obey(core, {@id, <<2, from::little-16, size::little-16>>}, at_ms) when from + size <= 182,
    do: reply(core, 0, core |> registers(at_ms) |> binary_part(from, size))

  defp obey(core, {@id, <<3, address::little-16, data::binary>>}, at_ms) do
    case order(core, address, data, at_ms) do
      :refused -> reply(core, 7, <<>>)
      core -> reply(core, 0, <<>>)
    end
  end

  defp obey(core, {@id, _unknown}, _at_ms), do: reply(core, 2, <<>>)
  defp obey(core, {_another, _body}, _at_ms), do: core

  defp order(core, 19, <<_counter>>, at_ms),
    do: %{core | beat_ms: at_ms, counts: %{core.counts | beats: core.counts.beats + 1}}

  defp order(core, address, <<_value>>, _at_ms) when address in [20, 21, 22, 23, 50], do: core

  defp order(core, 59, <<1>>, at_ms),
    do: %{core | still_ms: at_ms + @still_ms, disturbed?: false}

  defp order(core, 149, <<torque>>, at_ms) do
    core = %{core | torque?: torque == 1}
    if torque == 1, do: core, else: tell(core, {0, 0}, at_ms)
  end

  defp order(core, 150, <<linear::little-signed-32, _::128, turn::little-signed-32>>, at_ms) do
    half = turn / 100 * core.wheels.base / 2
    may? = core.torque? and core.options.motors and beating?(core, at_ms)
    speeds = if may?, do: {linear / 100 - half, linear / 100 + half}, else: {0, 0}
    tell(core, speeds, at_ms)
  end

  defp order(core, address, <<_value::32>>, _at_ms) when address in [174, 178], do: core
  defp order(_core, _address, _data, _at_ms), do: :refused

  defp tell(core, speeds, at_ms), do: %{core | wheels: Wheels.tell(core.wheels, speeds, at_ms)}

  defp beating?(%{beat_ms: nil}, _at_ms), do: false
  defp beating?(%{beat_ms: beat_ms}, at_ms), do: at_ms - beat_ms < @beat_ms

  defp reply(core, error, data) do
    body = stuffed(<<0x55, error, data::binary>>)
    framed = <<0xFF, 0xFF, 0xFD, 0, @id, byte_size(body) + 2::little-16, body::binary>>
    %{core | out: [core.out, framed, <<crc(framed)::little-16>>]}
  end

  defp stuffed(<<0xFF, 0xFF, 0xFD, rest::binary>>),
    do: <<0xFF, 0xFF, 0xFD, 0xFD, stuffed(rest)::binary>>

  defp stuffed(<<byte, rest::binary>>), do: <<byte, stuffed(rest)::binary>>
  defp stuffed(<<>>), do: <<>>

  # The control table, 182 bytes.
  defp registers(core, at_ms) do
    {left, right} = core.wheels.gone
    {left_start, right_start} = core.options.counters
    heading = 0.3 + Wheels.turned(core.wheels)
    status = if core.options.motors, do: 0, else: -1

    written = [
      {0, <<0x4010::little-16>>},
      {7, <<@id>>},
      {10, <<core.options.clock + at_ms - core.booted_ms::little-32>>},
      {18, <<status::signed-8>>},
      {42, <<core.options.centivolts::little-32>>},
      {96, float(:math.cos(heading / 2))},
      {108, float(:math.sin(heading / 2))},
      {136, <<left_start + ticks(left)::little-32, right_start + ticks(right)::little-32>>},
      {149, <<if(core.torque?, do: 1, else: 0)>>}
    ]

    Enum.reduce(written, <<0::size(182)-unit(8)>>, fn {address, bytes}, table ->
      size = byte_size(bytes)
      <<before::binary-size(address), _::binary-size(size), later::binary>> = table
      before <> bytes <> later
    end)
  end

  defp float(number), do: <<number::little-float-32>>
  defp ticks(metres), do: round(metres / (2 * :math.pi() * @radius) * @ticks)

  @impl Sim.Emulator.Core
  def wheels(%__MODULE__{} = core, at_ms), do: advance(core, at_ms).wheels |> Wheels.twist()

  @impl Sim.Emulator.Core
  def next_ms(%__MODULE__{wheels: %{at_ms: at_ms}}), do: at_ms + @period_ms

  @impl Sim.Emulator.Core
  def run(%__MODULE__{} = core, at_ms) do
    core = advance(core, at_ms)
    {wishes, wheels} = Wheels.wishes(core.wheels, at_ms)
    {core.out, wishes, %{core | out: [], wheels: wheels}}
  end

  # The watchdog stops the wheels at its own time, however late this is.
  defp advance(%{beat_ms: beat_ms} = core, at_ms)
       when beat_ms != nil and at_ms - beat_ms >= @beat_ms do
    core = %{core | wheels: Wheels.tell(core.wheels, {0, 0}, beat_ms + @beat_ms)}
    turn(%{core | beat_ms: nil}, at_ms)
  end

  defp advance(core, at_ms), do: turn(core, at_ms)

  defp turn(core, at_ms) do
    wheels = Wheels.advance(core.wheels, at_ms)
    moves? = wheels.moved_ms != core.wheels.moved_ms
    calibrates? = core.still_ms != nil and at_ms < core.still_ms
    %{core | wheels: wheels, disturbed?: core.disturbed? or (moves? and calibrates?)}
  end
end
