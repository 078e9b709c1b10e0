defmodule Sim.Emulator.Arduino do
  @moduledoc """
  Emulates a base whose Arduino speaks the text protocol of ros_arduino_bridge, written from the fact sheet alone. Pure;
  `Sim.Emulator` runs it.

  | option | allowed | meaning |
  |---|---|---|
  | `:ticks`, `:wheel_radius`, `:wheel_base` | counts a turn; metres | its wheels (1_440, 0.033, 0.2) |
  | `:acceleration` | m/s2 | of its wheels (2.0) |
  | `:boot_ms` | ms | how long it hears nothing after it was switched on (0); opening the line of a real one resets it, for 2_000 |

  **The wheels stop 2 s after the last command for them.** Commands end with a carriage return, answers with both characters; what it
  does not know is `Invalid Command`. Where the sheet leaves it open: of a line that is longer than 32 characters the rest is lost.
  """
  use Sim.Emulator.Wheels
  alias Hal.Options
  alias Sim.Emulator.Wheels

  @loop_hz 30
  @stop_ms 2_000
  @longest 32
  @period_ms 20

  @table [
    ticks: [{:integer, 1, 10_000_000}, default: 1_440],
    wheel_radius: [{:number, 0.005, 1.0, "m"}, default: 0.033],
    wheel_base: [{:number, 0.02, 3.0, "m"}, default: 0.2],
    acceleration: [{:number, 0.01, 100, "m/s2"}, default: 2.0],
    boot_ms: [{:integer, 0, 60_000, "ms"}, default: 0]
  ]

  @enforce_keys [:options, :wheels, :deaf_ms]
  defstruct @enforce_keys ++
              [line: "", out: [], told_ms: nil, zero: {0.0, 0.0}, counts: %{bad: 0}]

  @type t :: %__MODULE__{}

  @impl Sim.Emulator.Core
  def new(options, at_ms) do
    with {:ok, options} <- Options.check(options, @table, "arduino emulator") do
      options = Map.new(options)
      wheels = Wheels.new(options.wheel_base, options.acceleration, at_ms)
      {:ok, %__MODULE__{options: options, wheels: wheels, deaf_ms: at_ms + options.boot_ms}}
    end
  end

  @impl Sim.Emulator.Core
  def hear(%__MODULE__{deaf_ms: deaf_ms} = core, _bytes, at_ms) when at_ms < deaf_ms, do: core

  def hear(%__MODULE__{} = core, bytes, at_ms),
    do:
      for(<<byte <- bytes>>, reduce: advance(core, at_ms), do: (core -> byte(core, byte, at_ms)))

  defp byte(%{line: ""} = core, ?\r, _at_ms), do: core

  defp byte(core, ?\r, at_ms) do
    words = String.split(core.line, " ", trim: true)
    obey(%{core | line: ""}, words, at_ms)
  end

  defp byte(core, _byte, _at_ms) when byte_size(core.line) >= @longest, do: core
  defp byte(core, byte, _at_ms), do: %{core | line: core.line <> <<byte>>}

  defp obey(core, ["b"], _at_ms), do: answer(core, "57600")
  defp obey(core, ["r"], _at_ms), do: answer(%{core | zero: core.wheels.gone}, "OK")

  defp obey(core, ["e"], _at_ms) do
    [left, right] = for n <- [0, 1], do: counts(core, n)
    answer(core, "#{left} #{right}")
  end

  # As `atoi` of C: what is no number is 0.
  defp obey(core, ["m" | targets], at_ms) do
    [left, right] = for n <- [0, 1], do: speed(core, Enum.at(targets, n, "0"))
    wheels = Wheels.tell(core.wheels, {left, right}, at_ms)
    answer(%{core | wheels: wheels, told_ms: at_ms}, "OK")
  end

  defp obey(core, ["u", _gains], _at_ms), do: answer(core, "OK")

  defp obey(core, _unknown, _at_ms),
    do: answer(%{core | counts: %{bad: core.counts.bad + 1}}, "Invalid Command")

  defp speed(core, text) do
    target = with {number, _rest} <- Integer.parse(text), do: number, else: (:error -> 0)
    target * @loop_hz / core.options.ticks * round_m(core)
  end

  defp counts(core, n) do
    count =
      round((elem(core.wheels.gone, n) - elem(core.zero, n)) / round_m(core) * core.options.ticks)

    <<wrapped::signed-32>> = <<count::32>>
    wrapped
  end

  defp round_m(core), do: 2 * :math.pi() * core.options.wheel_radius

  defp answer(core, line), do: %{core | out: [core.out, line, "\r\n"]}

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

  # The wheels stop at the firmware's own time, however late this is.
  defp advance(%{told_ms: told_ms} = core, at_ms)
       when told_ms != nil and at_ms - told_ms >= @stop_ms do
    wheels = Wheels.tell(core.wheels, {0, 0}, told_ms + @stop_ms)
    %{core | wheels: Wheels.advance(wheels, at_ms), told_ms: nil}
  end

  defp advance(core, at_ms), do: %{core | wheels: Wheels.advance(core.wheels, at_ms)}
end
