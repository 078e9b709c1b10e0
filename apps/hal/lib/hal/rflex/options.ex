defmodule Hal.RFlex.Options do
  @moduledoc false
  # Checks the options of `Hal.RFlex.Driver`, where they are listed: their table, and the defaults that follow from the
  # body. Pure.
  alias Hal.{Options, Profile, Serial, SerialBase}
  alias Hal.RFlex.Conversions
  alias Hal.RFlex.Sensors.Bumpers
  alias Hal.RFlex.Sensors.Infrared

  @per_metre {:number, 1.0e-3, 1.0e7, "units per metre"}
  @conversions [
    distance: [@per_metre, default: nil],
    angle: [{:number, 1.0e-3, 1.0e7, "units per radian"}, default: nil],
    # The two wheels of a base differ by some thousandths; far more than that is not a pair.
    wheel_ratio: {:number, 0.8, 1.25},
    range: [@per_metre, default: nil],
    ir_a: [
      {:check, &__MODULE__.ir_a/1, "a number from 1.0e-9 to 1.0e9, or a list of them"},
      default: nil
    ],
    ir_b: [
      {:check, &__MODULE__.ir_b/1, "a number from -10.0 to 10.0, or a list of them"},
      default: nil
    ]
  ]
  @bumpers [
    style: {:one_of, [:bit, :address]},
    base: {:integer, 0, 255},
    count: {:integer, 0, 64},
    segments: {:list, {:integer, 0, 15}}
  ]
  @times {:tuple, [{:integer, 1, 1_000_000}, {:integer, 0, 1_000_000}, {:integer, 0, 1_000_000}],
          "{echo, ping, set}, whole microseconds up to 1000000,"}
  @ratio {:number, -1.0, 1.0}
  @ratios {:tuple, [@ratio, @ratio], "{m/s, rad/s} a count, numbers from -1.0 to 1.0,"}
  @own [
    profile: [
      {:check, &__MODULE__.profile/1, ":magellan, :atrv_mini or a %Hal.Profile{}"},
      default: Profile.magellan()
    ],
    conversions: [{:keys, @conversions}, default: []],
    bumpers: [{:keys, @bumpers}, default: []],
    sonar_banks: [{:list, {:integer, 0, 16}, 16}, default: nil],
    sonar_stride: [{:integer, 1, 16}, default: 16],
    sonar_age: [{:integer, 1, 20}, default: 1],
    sonar_times: [@times, default: nil],
    ir_banks: [{:list, {:integer, 0, 8}, 8}, default: nil],
    ir_base_bank: [{:integer, 0, 7}, default: 0],
    ir_order: [{:list, {:integer, 0, 63}}, default: nil],
    ir_law: [{:one_of, [:metres, :millimetres]}, default: :metres],
    ir_min: [{:number, 0.0, 1.0, "m"}, default: 0.1],
    power_offset: [{:number, -10.0, 10.0, "V"}, default: 0.0],
    joystick: [:boolean, default: false],
    joystick_ratios: [@ratios, default: {0.006, -0.01}],
    home: [{:integer, 0, 255}, default: nil],
    report_period: [{:integer, 20_000, 200_000, "microseconds"}, default: 100_000],
    pace_ms: [{:integer, 1, 50, "ms"}, default: 12]
  ]
  @table SerialBase.Options.table(115_200) ++ @own

  @enforce_keys Keyword.keys(@table)
  defstruct @enforce_keys

  @type t :: %__MODULE__{}

  @doc "The table of the options."
  @spec table() :: Options.table()
  def table, do: @table

  @doc """
  Checks the options; the error is one line that says what is wrong.

      iex> Hal.RFlex.Options.new(port: "/dev/ttyR0", conversions: [distance: -1])
      {:error, "rflex option conversions.distance: expected a number from 0.001 to 1.0e7 units per metre, got -1"}
  """
  @spec new(keyword()) :: {:ok, t()} | {:error, String.t()}
  def new(options) do
    with {:ok, given} <- Options.check(options, @table, "rflex"),
         {:ok, _line} <- Serial.options(SerialBase.Options.line(given)),
         {:ok, limits} <- SerialBase.Options.limits(given[:limits], given[:profile], "rflex"),
         {:ok, bumpers} <- bumpers(given[:bumpers], given[:profile]),
         conversions = struct!(Conversions, given[:conversions]),
         # Without the option `profile`, the robot file checks this itself.
         {:ok, given} <- sensors(given, conversions, options[:profile] != nil) do
      new = [conversions: conversions, limits: limits, bumpers: bumpers]
      {:ok, struct!(__MODULE__, Keyword.merge(given, new))}
    end
  end

  @doc false
  def profile(kind) when kind in [:magellan, :atrv_mini], do: {:ok, apply(Profile, kind, [])}
  def profile(other), do: is_struct(other, Profile)

  @doc false
  def ir_a(value), do: one_or_each(value, 1.0e-9, 1.0e9)
  @doc false
  def ir_b(value), do: one_or_each(value, -10.0, 10.0)

  defp one_or_each([], _least, _most), do: false

  defp one_or_each(value, least, most) do
    type = {:number, least, most}
    type = if is_list(value), do: {:list, type}, else: type
    with {:error, _problems} <- Options.Type.read(type, value), do: false
  end

  # Works out which sensors a base has on which boards: from the options and, for what they leave out, from
  # what is usual for its body. Pure; the options are those of `Hal.RFlex.Options`.

  # The bumpers; the error says what is wrong with the options.
  defp bumpers(options, profile) do
    style = options[:style] || :bit
    count = options[:count] || profile.bumpers
    segments = options[:segments] || Bumpers.default_segments(style, count)
    base = options[:base] || 0x40

    if length(segments) == count,
      do: {:ok, %Bumpers{style: style, base: base, count: count, segments: segments}},
      else: refuse([:bumpers, :segments], segments, "a segment for each of the #{count} bumpers")
  end

  # The options with boards, times and order filled in; `own?` says that the options have a profile.
  defp sensors(given, conversions, own?) do
    given = Keyword.merge(given, usual(given))
    count = Enum.sum(given[:ir_banks])

    with :ok <- fits(:sonar_banks, given, length(given[:profile].sonars), own?),
         :ok <- fits(:ir_banks, given, length(given[:profile].irs), own?),
         :ok <- order(given[:ir_order], count),
         :ok <- each([:conversions, :ir_a], conversions.ir_a, count),
         :ok <- each([:conversions, :ir_b], conversions.ir_b, count),
         do: {:ok, given}
  end

  defp usual(given) do
    profile = given[:profile]
    irs = given[:ir_banks] || eights(length(profile.irs))
    count = Enum.sum(irs)
    # The pause after each ping that is published for a Magellan; an ATRV mini has none.
    ping = if profile.rflex == :magellan, do: 1250, else: 0

    order =
      if profile.rflex == :magellan and count == 16,
        do: Infrared.magellan_order(),
        else: Enum.to_list(0..(count - 1)//1)

    [
      sonar_banks: given[:sonar_banks] || eights(length(profile.sonars)),
      sonar_times: given[:sonar_times] || {30_000, ping, 0},
      ir_banks: irs,
      ir_order: given[:ir_order] || order
    ]
  end

  defp eights(0), do: []
  defp eights(n) when n <= 8, do: [n]
  defp eights(n), do: [8 | eights(n - 8)]

  defp fits(key, given, poses, own?) do
    if own? and Enum.sum(given[key]) != poses,
      do: refuse([key], given[key], "#{poses} together, as many as the body has poses for,"),
      else: :ok
  end

  defp order(order, count) do
    if Enum.sort(order) == Enum.to_list(0..(count - 1)//1),
      do: :ok,
      else: refuse([:ir_order], order, "a list of #{count} places, each once, counted from 0,")
  end

  defp each(path, values, count) when is_list(values) and length(values) != count,
    do: refuse(path, values, "one for each of #{count} infrareds")

  defp each(_path, _values, _count), do: :ok

  defp refuse(path, value, allowed), do: Options.refuse("rflex", path, value, allowed)
end
