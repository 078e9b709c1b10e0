defmodule Sim.Emulator.Kobuki do
  @moduledoc """
  Emulates a Kobuki at the other end of the serial line, written from the fact sheet alone. Pure; `Sim.Emulator` runs it.

  | option | allowed | meaning |
  |---|---|---|
  | `:counters` | `{left, right}`, 0 to 0xFFFF | where its encoders begin (`{0xFF00, 0xFF00}`, so that they soon wrap) |
  | `:clock` | 0 to 0xFFFF | where its clock begins (`0xFF00`) |
  | `:acceleration` | m/s2 | of its wheels (2.0): the sheet has none, only that the base jumps without a ramp |
  | `:firmware` | `{major, minor, patch}` | (`{1, 2, 0}`) |
  | `:decivolts` | 0 to 255 | of its battery (160) |

  **It has no time-out**: it does what it was told last. It reports every 20 ms, unasked, with both bytes of a packet's start
  in its raw gyro values. Its bumpers, wheel drops and cliff sensors only report; over 3 A it cuts the power of its motors.
  Where the sheet leaves it open: its angle wraps at 180 degrees, and a command's half is kept until the rest comes,
  and a command with a wrong sum is lost as a whole.
  """
  use Sim.Emulator.Wheels
  alias Hal.Options
  alias Sim.Emulator.Wheels
  import Bitwise

  @period_ms 20
  @base 0.230
  @metres_per_tick 8.5292090e-5
  # The longest that a command has, and more than that is noise.
  @longest 255

  @word {:integer, 0, 0xFFFF}
  @byte {:integer, 0, 255}
  @table [
    counters: [{:tuple, [@word, @word], "{left, right}, 0 to 65535,"}, default: {0xFF00, 0xFF00}],
    clock: [@word, default: 0xFF00],
    acceleration: [{:number, 0.01, 100, "m/s2"}, default: 2.0],
    firmware: [{:tuple, [@byte, @byte, @byte], "{major, minor, patch}"}, default: {1, 2, 0}],
    decivolts: [@byte, default: 160]
  ]

  @enforce_keys [:options, :wheels, :due_ms, :booted_ms]
  defstruct @enforce_keys ++
              [
                buffer: <<>>,
                bumpers: 0,
                drops: 0,
                cliffs: 0,
                overcurrent: 0,
                asked: [],
                counts: %{packets: 0, bad: 0}
              ]

  @type t :: %__MODULE__{}

  @impl Sim.Emulator.Core
  def new(options, at_ms) do
    with {:ok, options} <- Options.check(options, @table, "kobuki emulator") do
      wheels = Wheels.new(@base, options[:acceleration], at_ms)

      {:ok,
       %__MODULE__{
         options: Map.new(options),
         wheels: wheels,
         due_ms: at_ms + @period_ms,
         booted_ms: at_ms
       }}
    end
  end

  @impl Sim.Emulator.Core
  def hear(%__MODULE__{} = core, bytes, at_ms) do
    {payloads, rest, bad} = cut(core.buffer <> bytes, [], 0)
    counts = %{packets: core.counts.packets + length(payloads), bad: core.counts.bad + bad}
    Enum.reduce(payloads, %{core | buffer: rest, counts: counts}, &obey(&2, &1, at_ms))
  end

  # AA 55, length, payload, and a sum that makes the exclusive or of all from the length on 0.
  defp cut(<<0xAA, 0x55, size, rest::binary>> = bytes, found, bad) when size in 3..@longest do
    case rest do
      <<payload::binary-size(size), sum, later::binary>> ->
        if for(<<(byte <- <<size, payload::binary, sum>>)>>, reduce: 0, do: (x -> bxor(x, byte))) ==
             0,
           do: cut(later, [payload | found], bad),
           else: cut(later, found, bad + 1)

      _unfinished ->
        {Enum.reverse(found), bytes, bad}
    end
  end

  defp cut(<<0xAA, 0x55>> = begun, found, bad), do: {Enum.reverse(found), begun, bad}
  defp cut(<<0xAA>> = begun, found, bad), do: {Enum.reverse(found), begun, bad}
  defp cut(<<_noise, rest::binary>>, found, bad), do: cut(rest, found, bad)
  defp cut(<<>>, found, bad), do: {Enum.reverse(found), <<>>, bad}

  defp obey(core, <<id, size, data::binary-size(size), rest::binary>>, at_ms),
    do: core |> order(id, data, at_ms) |> obey(rest, at_ms)

  defp obey(core, _end, _at_ms), do: core

  defp order(core, 1, <<speed::little-signed-16, radius::little-signed-16>>, at_ms),
    do: %{core | wheels: Wheels.tell(core.wheels, speeds(speed / 1_000, radius), at_ms)}

  defp order(core, 9, <<flags::little-16>>, _at_ms) do
    ids = for {flag, id} <- [{1, 10}, {2, 11}, {8, 19}], (flags &&& flag) != 0, do: id
    %{core | asked: Enum.uniq(core.asked ++ ids)}
  end

  defp order(core, _other, _data, _at_ms), do: core

  # The speed is that of the outer wheel.
  defp speeds(speed, 0), do: {speed, speed}
  defp speeds(speed, 1), do: {-speed, speed}
  defp speeds(speed, radius) when radius > 0, do: {speed * (radius - 115) / (radius + 115), speed}
  defp speeds(speed, radius), do: {speed, speed * (radius + 115) / (radius - 115)}

  @impl Sim.Emulator.Core
  def feel(%__MODULE__{} = core, {:bumpers, pressed}, _at_ms),
    do: %{core | bumpers: pressed |> Enum.map(&switch/1) |> Enum.reduce(0, &bor/2)}

  def feel(%__MODULE__{} = core, other, at_ms), do: super(core, other, at_ms)

  # Sixteen places round a body, counter-clockwise from the front; behind there is no bumper.
  defp switch(place) when place in [15, 0, 1], do: 2
  defp switch(place) when place in 2..4, do: 4
  defp switch(place) when place in 12..14, do: 1
  defp switch(_behind), do: 0

  @doc "From now on these bits are in its reports: `bumpers`, `drops`, `cliffs`, `overcurrent`."
  @spec set(t(), :bumpers | :drops | :cliffs | :overcurrent, byte()) :: t()
  def set(%__MODULE__{} = core, what, bits)
      when what in [:bumpers, :drops, :cliffs, :overcurrent],
      do: Map.replace!(core, what, bits)

  @impl Sim.Emulator.Core
  def wheels(%__MODULE__{} = core, at_ms), do: advance(core, at_ms).wheels |> Wheels.twist()

  @impl Sim.Emulator.Core
  def next_ms(%__MODULE__{due_ms: due_ms}), do: due_ms

  @impl Sim.Emulator.Core
  def run(%__MODULE__{} = core, at_ms), do: core |> advance(at_ms) |> report(at_ms) |> wish(at_ms)

  defp advance(core, at_ms) do
    wheels = if core.overcurrent == 0, do: core.wheels, else: %{core.wheels | told: {0.0, 0.0}}
    %{core | wheels: Wheels.advance(wheels, at_ms)}
  end

  defp report(%{due_ms: due_ms} = core, at_ms) when at_ms < due_ms, do: {[], core}

  # After a delay it does not make up for the reports it missed.
  defp report(core, at_ms) do
    next_ms = max(core.due_ms + @period_ms, at_ms + 1)
    {packet(payload(core, at_ms)), %{core | due_ms: next_ms, asked: []}}
  end

  defp wish({bytes, core}, at_ms) do
    {wishes, wheels} = Wheels.wishes(core.wheels, at_ms)
    {bytes, wishes, %{core | wheels: wheels}}
  end

  defp payload(core, at_ms) do
    time = core.options.clock + at_ms - core.booted_ms
    {left, right} = core.wheels.gone
    {left_start, right_start} = core.options.counters
    hundredths = round(Wheels.turned(core.wheels) * 18_000 / :math.pi())
    angle = Integer.mod(hundredths + 18_000, 36_000) - 18_000

    IO.iodata_to_binary([
      <<1, 15, time::little-16, core.bumpers, core.drops, core.cliffs>>,
      <<left_start + ticks(left)::little-16, right_start + ticks(right)::little-16>>,
      <<0::16, 0, 0, core.options.decivolts, core.overcurrent>>,
      <<3, 3, 0::24>>,
      <<4, 7, angle::little-signed-16, 0::16, 0::24>>,
      <<5, 6, 0::48>>,
      <<6, 2, 0::16>>,
      # Frame, six values: two samples of x, y, z. The first bytes look like the start of a packet.
      <<13, 14, div(time, @period_ms), 6, 0xAA, 0x55, 0x4D, 0::72>>,
      <<16, 16, 0::128>>,
      Enum.map(core.asked, &extra(core, &1))
    ])
  end

  defp extra(_core, 10), do: <<10, 4, 4, 0, 1, 0>>

  defp extra(%{options: %{firmware: {major, minor, patch}}}, 11),
    do: <<11, 4, patch, minor, major, 0>>

  defp extra(_core, 19), do: <<19, 12, 0::96>>

  defp ticks(metres), do: round(metres / @metres_per_tick)

  defp packet(payload) do
    body = <<byte_size(payload), payload::binary>>
    [0xAA, 0x55, body, for(<<byte <- body>>, reduce: 0, do: (sum -> bxor(sum, byte)))]
  end
end
