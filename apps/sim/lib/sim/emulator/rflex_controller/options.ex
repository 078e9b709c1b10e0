defmodule Sim.Emulator.RFlexController.Options do
  @moduledoc """
  Checks the options of an emulated controller. Pure. All options have defaults, which depend on the `:kind`.

  | option | allowed | meaning |
  |---|---|---|
  | `:kind` | `:magellan`, `:atrv_mini` | whose conversions, sonars, infrareds and bumpers (`:magellan`) |
  | `:conversions` | keywords `distance`, `angle`, `range`, `ir_a`, `ir_b`; numbers, not 0 | counts a metre, counts a radian, raw sonar a metre; infrared range = a V^b metres |
  | `:sonar_banks`, `:ir_banks` | lists of 0 to 16, 0 to 8 | sensors fitted on each board |
  | `:ir_wiring` | list of whole numbers | the profile's infrared on each input, bank after bank |
  | `:sonar_per_report` | 1 to 64 | number of echoes in a report (4) |
  | `:missed_echo` | 0 to 0xFFFF | raw range when no echo comes (0x7FFF) |
  | `:sonar_max`, `:ir_max` | metres | ranges of the body from this on mean that nothing was there (5.1, 0.8) |
  | `:bumper_style` | `:bit`, `:address` | one bit or one address per bumper (`:bit`) |
  | `:bumper_base`, `:bumpers` | byte, 0 to 16 | first address, number of bumpers |
  | `:counters` | `{distance, bearing}` | where they start to count, signed 32 bits (`{0, 0}`) |
  | `:timeout_ms` | whole number or `:off` | motors stop if no motion command came for this long (1000) |
  | `:brake` | `:set`, `:released` | state when it is switched on (`:set`); a set brake holds the wheels |
  | `:ghost` | `:off`, `:infrared`, `:all` | see `Sim.Emulator.RFlexController.Frame` |
  | `:escape` | `:drop`, `:take` | turn commands with 1B in their top or third byte are lost, or not (`:drop`) |
  | `:pace` | `{ms, room}` or `:off` | takes one command every `ms`, and at most `room` may wait (`:off`) |
  | `:give_up_ms` | 1 to 10000 | how long it waits for the rest of a command (50) |
  | `:phrase` | bytes or `nil` | text on the line that switches it off ("The system is halted") |
  | `:power_offset` | volts | true voltage minus reported voltage (0.0; mini 1.2) |
  | `:home` | `{address, from, to}` or `nil` | switch that is closed between two bearings, radians |
  | `:id` | byte | of the first report (0) |
  """
  alias Hal.Options

  @factor {:check, &__MODULE__.factor?/1, "a number, not 0,"}
  @conversions [distance: @factor, angle: @factor, range: @factor, ir_a: @factor, ir_b: @factor]
  @word {:integer, -0x80000000, 0x7FFFFFFF}
  # The second board counts from right of the front outwards, then from the left to the front.
  @wiring Enum.to_list(0..7) ++ [12, 13, 14, 15, 8, 9, 10, 11]

  @table [
    kind: [{:one_of, [:magellan, :atrv_mini]}, default: :magellan],
    conversions: [
      {:keys, @conversions},
      default: [distance: 31_387, angle: 4654.2, range: 1474, ir_a: 4000, ir_b: -2]
    ],
    sonar_banks: [{:list, {:integer, 0, 16}}, default: [8, 8]],
    ir_banks: [{:list, {:integer, 0, 8}}, default: [8, 8]],
    ir_wiring: [{:list, {:integer, 0, 63}}, default: @wiring],
    sonar_per_report: [{:integer, 1, 64}, default: 4],
    missed_echo: [{:integer, 0, 0xFFFF}, default: 0x7FFF],
    sonar_max: [{:number, 1.0e-3, 1_000, "m"}, default: 5.1],
    ir_max: [{:number, 1.0e-3, 1_000, "m"}, default: 0.8],
    bumper_style: [{:one_of, [:bit, :address]}, default: :bit],
    bumper_base: [{:integer, 0, 255}, default: 0x40],
    bumpers: [{:integer, 0, 16}, default: 16],
    counters: [{:tuple, [@word, @word], "{distance, bearing}, whole numbers,"}, default: {0, 0}],
    timeout_ms: [{:or, :off, {:integer, 1, 3_600_000, "ms"}}, default: 1_000],
    brake: [{:one_of, [:set, :released]}, default: :set],
    ghost: [{:one_of, [:off, :infrared, :all]}, default: :infrared],
    escape: [{:one_of, [:drop, :take]}, default: :drop],
    pace: [
      {:or, :off, {:tuple, [{:integer, 1, 60_000}, {:integer, 1, 60_000}], "{ms, room}"}},
      default: :off
    ],
    give_up_ms: [{:integer, 1, 10_000, "ms"}, default: 50],
    phrase: [
      {:or, nil, {:check, &__MODULE__.phrase?/1, "text of up to 256 bytes"}},
      default: "The system is halted"
    ],
    power_offset: [{:number, -100, 100, "V"}, default: 0.0],
    home: [
      {:tuple, [{:integer, 0, 255}, {:number, -100, 100}, {:number, -100, 100}],
       "{address, from, to}"},
      default: nil
    ],
    id: [{:integer, 0, 255}, default: 0]
  ]

  @atrv_mini [
    conversions: [distance: 190_000, angle: 60_000, range: 1476, ir_a: 4000, ir_b: -2],
    ir_banks: [],
    ir_wiring: [],
    bumpers: 0,
    power_offset: 1.2
  ]

  @doc """
  All options of a controller; the error is one line that names what is wrong.

      iex> {:ok, options} = Sim.Emulator.RFlexController.Options.check(kind: :atrv_mini, timeout_ms: :off)
      iex> {options.conversions[:angle], options.timeout_ms}
      {60000, :off}
      iex> Sim.Emulator.RFlexController.Options.check(ghost: :yes)
      {:error, "controller option ghost: expected :off, :infrared or :all, got :yes"}
  """
  @spec check(keyword()) :: {:ok, map()} | {:error, line :: String.t()}
  def check(asked) do
    with {:ok, options} <- Options.check(asked, @table, "controller") do
      kind = if options[:kind] == :atrv_mini, do: @atrv_mini, else: []
      usual = @table |> Options.defaults() |> Keyword.merge(kind)
      given = Keyword.take(options, Keyword.keys(asked))
      conversions = Keyword.merge(usual[:conversions], given[:conversions] || [])
      {:ok, usual |> Keyword.merge(given) |> Map.new() |> Map.put(:conversions, conversions)}
    end
  end

  @doc false
  def factor?(number), do: is_number(number) and number != 0

  @doc false
  def phrase?(text), do: is_binary(text) and byte_size(text) in 1..256
end
