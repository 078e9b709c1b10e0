defmodule Hal.RFlex.Options do
  @moduledoc """
  What `Hal.RFlex.Driver` is started with, checked, with all defaults filled in. Pure.
  The table is in the driver's documentation.
  """
  alias Hal.{Profile, Serial, SlewLimiter}
  alias Hal.RFlex.{Bumpers, Conversions, Infrared}

  @defaults [
    port: nil,
    speed: 115_200,
    serial: [],
    profile: :magellan,
    conversions: [],
    limits: [],
    bumpers: [],
    sonar_banks: nil,
    sonar_stride: 16,
    sonar_age: 1,
    sonar_times: nil,
    ir_banks: nil,
    ir_base_bank: 0,
    ir_order: nil,
    ir_law: :metres,
    ir_min: 0.1,
    power_offset: 0.0,
    joystick: false,
    home: nil,
    report_period: 100_000,
    pace_ms: 12,
    clock: {System, :monotonic_time, [:millisecond]}
  ]
  @keys Keyword.keys(@defaults)
  @conversions [:distance, :angle, :wheel_ratio, :range, :ir_a, :ir_b]
  @limits [
    :max_linear,
    :max_turn,
    :max_acceleration,
    :max_turn_acceleration,
    :max_braking,
    :max_turn_braking
  ]

  @enforce_keys @keys
  defstruct @keys

  @type t :: %__MODULE__{}

  @doc """
  Checks options; or says in one line what is wrong.

      iex> Hal.RFlex.Options.new(port: "/dev/ttyR0", conversions: [distance: -1])
      {:error, "rflex option conversions: distance: cannot be -1: it must be a number above 0 and up to 10000000.0, units per metre"}
  """
  @spec new(keyword()) :: {:ok, t()} | {:error, String.t()}
  def new(options) do
    with :ok <- known([], options, @keys),
         given = Keyword.merge(@defaults, options),
         {:ok, profile} <- profile(given[:profile]),
         given = Keyword.put(given, :profile, profile),
         :ok <- serial(given),
         :ok <- each(@keys -- [:port, :serial, :profile], given, profile),
         {:ok, conversions} <- conversions(given),
         {:ok, limits} <- limits(given),
         {:ok, bumpers} <- bumpers(given),
         given = banks(given),
         # Without a profile of its own a robot file checks this itself.
         :ok <- fits(given, options[:profile] != nil),
         :ok <- infrared(given, conversions) do
      new = [conversions: conversions, limits: limits, bumpers: bumpers]
      {:ok, struct!(__MODULE__, Keyword.merge(given, new))}
    end
  end

  defp known(path, options, keys) do
    cond do
      not Keyword.keyword?(options) ->
        wrong(path, options, "a keyword list")

      unknown = Enum.find(Keyword.keys(options), &(&1 not in keys)) ->
        {:error,
         "rflex option #{words(path ++ [unknown])} is not known: allowed are #{Enum.join(keys, ", ")}"}

      twice = Enum.find(Keyword.keys(options), &(length(Keyword.get_values(options, &1)) > 1)) ->
        {:error, "rflex option #{words(path ++ [twice])} is given twice"}

      true ->
        :ok
    end
  end

  defp profile(:magellan), do: {:ok, Profile.magellan()}
  defp profile(:atrv_mini), do: {:ok, Profile.atrv_mini()}
  defp profile(%Profile{} = profile), do: {:ok, profile}
  defp profile(other), do: wrong([:profile], other, ":magellan, :atrv_mini or a Hal.Profile")

  defp serial(given) do
    with :ok <- known([:serial], given[:serial], [:pty, :module, :keep_alive_ms]),
         :ok <- keep_alive(given[:serial][:keep_alive_ms]),
         {:ok, _options} <- Serial.options(line(given)),
         do: :ok
  end

  # Wheels of a VM that is frozen turn on for that long; and the driver gives a sign of life each 50 ms.
  defp keep_alive(nil), do: :ok
  defp keep_alive(ms) when is_integer(ms) and ms in 100..300, do: :ok

  defp keep_alive(other),
    do: wrong([:serial, :keep_alive_ms], other, "whole milliseconds from 100 to 300")

  @doc "The options for `Hal.Serial.open/1`, without last words."
  @spec line(keyword() | t()) :: keyword()
  def line(%__MODULE__{} = options), do: line(Map.to_list(Map.from_struct(options)))

  def line(options) do
    port = if options[:port] == nil, do: [], else: [port: options[:port]]
    port ++ [speed: options[:speed]] ++ options[:serial]
  end

  defp each(keys, given, profile) do
    Enum.find_value(keys, :ok, fn key ->
      if not valid?(key, given[key], profile), do: wrong([key], given[key], rule(key))
    end)
  end

  defp valid?(:speed, speed, _), do: is_integer(speed)
  defp valid?(key, list, _) when key in [:conversions, :limits, :bumpers], do: is_list(list)

  defp valid?(:sonar_banks, banks, _),
    do: banks == nil or (whole_list?(banks, 0, 16) and length(banks) <= 16)

  defp valid?(:ir_banks, banks, _),
    do: banks == nil or (whole_list?(banks, 0, 8) and length(banks) <= 8)

  defp valid?(:ir_base_bank, bank, _), do: is_integer(bank) and bank in 0..7
  defp valid?(:ir_order, order, _), do: order == nil or whole_list?(order, 0, 63)
  defp valid?(:ir_law, law, _), do: law in [:metres, :millimetres]
  defp valid?(:ir_min, least, _), do: number?(least, 0.0, 1.0)
  defp valid?(:sonar_stride, stride, _), do: is_integer(stride) and stride in 1..16
  defp valid?(:sonar_age, age, _), do: is_integer(age) and age in 1..20

  defp valid?(:sonar_times, times, _) do
    times == nil or
      (is_tuple(times) and tuple_size(times) == 3 and
         whole_list?(Tuple.to_list(times), 0, 1_000_000) and elem(times, 0) > 0)
  end

  defp valid?(:power_offset, volts, _), do: number?(volts, -10.0, 10.0)
  defp valid?(:joystick, joystick, _), do: is_boolean(joystick)
  defp valid?(:home, home, _), do: home == nil or (is_integer(home) and home in 0..255)

  defp valid?(:report_period, period, _), do: is_integer(period) and period in 20_000..200_000
  defp valid?(:pace_ms, ms, _), do: is_integer(ms) and ms in 1..50

  defp valid?(:clock, clock, _),
    do: match?({m, f, a} when is_atom(m) and is_atom(f) and is_list(a), clock)

  defp rule(:speed), do: "a whole number of baud"
  defp rule(key) when key in [:conversions, :limits, :bumpers], do: "a keyword list"
  defp rule(:sonar_banks), do: "a list of at most 16 whole numbers from 0 to 16"
  defp rule(:ir_banks), do: "a list of at most 8 whole numbers from 0 to 8"
  defp rule(:ir_base_bank), do: "a whole number from 0 to 7"
  defp rule(:ir_order), do: "a list of places, each once, counted from 0"
  defp rule(:ir_law), do: ":metres or :millimetres"
  defp rule(:ir_min), do: "a number from 0.0 to 1.0, in metres"
  defp rule(:sonar_stride), do: "a whole number from 1 to 16"
  defp rule(:sonar_age), do: "a whole number from 1 to 20"

  defp rule(:sonar_times),
    do: "{echo, ping, set}, whole microseconds up to 1000000, echo above 0"

  defp rule(:power_offset), do: "a number from -10.0 to 10.0, in volts"
  defp rule(:joystick), do: "true or false"
  defp rule(:home), do: "nil or an address from 0 to 255"
  defp rule(:report_period), do: "whole microseconds from 20000 to 200000"
  defp rule(:pace_ms), do: "whole milliseconds from 1 to 50"
  defp rule(:clock), do: "{module, function, arguments}"

  defp conversions(given) do
    with :ok <- known([:conversions], given[:conversions], @conversions),
         :ok <- all([:conversions], given[:conversions], &conversion/2),
         do: {:ok, struct!(Conversions, Enum.map(given[:conversions], &floats/1))}
  end

  defp floats({key, values}) when is_list(values), do: {key, Enum.map(values, &(&1 * 1.0))}
  defp floats({key, value}), do: {key, value && value * 1.0}

  # The two wheels of a base differ by some thousandths; what differs by more is not a pair.
  defp conversion(:wheel_ratio, value) do
    if number?(value, 0.8, 1.25), do: :ok, else: "a number from 0.8 to 1.25"
  end

  defp conversion(_key, nil), do: :ok

  defp conversion(key, value) when key in [:ir_a, :ir_b] do
    {least, most} = if key == :ir_a, do: {1.0e-9, 1.0e9}, else: {-10.0, 10.0}
    values = List.wrap(value)

    if values != [] and length(values) <= 64 and Enum.all?(values, &number?(&1, least, most)),
      do: :ok,
      else: "a number from #{least} to #{most}, or a list of one for each infrared"
  end

  defp conversion(key, value) do
    units = if key == :angle, do: "units per radian", else: "units per metre"

    if number?(value, 1.0e-3, 1.0e7),
      do: :ok,
      else: "a number above 0 and up to 10000000.0, #{units}"
  end

  defp limits(given) do
    profile = given[:profile]

    with :ok <- known([:limits], given[:limits], @limits),
         :ok <- all([:limits], given[:limits], &limit(&1, &2, profile)) do
      defaults = for key <- Enum.take(@limits, 4), do: {key, Map.fetch!(profile, key)}
      {:ok, SlewLimiter.new(Keyword.merge(defaults, given[:limits]))}
    end
  end

  defp limit(key, value, profile) do
    most = Map.get(profile, key, 10.0)

    if number?(value, 1.0e-3, most),
      do: :ok,
      else: "a number above 0 and up to #{most}, what the body can do"
  end

  defp bumpers(given) do
    options = given[:bumpers]

    with :ok <- known([:bumpers], options, [:style, :base, :count, :segments]),
         :ok <- all([:bumpers], options, &bumper/2) do
      style = options[:style] || :bit
      count = options[:count] || given[:profile].bumpers
      segments = options[:segments] || Bumpers.default_segments(style, count)

      if length(segments) == count do
        base = options[:base] || 0x40
        {:ok, %Bumpers{style: style, base: base, count: count, segments: segments}}
      else
        wrong([:bumpers, :segments], segments, "a segment for each of the #{count} bumpers")
      end
    end
  end

  defp bumper(:style, style) when style in [:bit, :address], do: :ok
  defp bumper(:style, _style), do: ":bit or :address"
  defp bumper(:base, base) when is_integer(base) and base in 0..255, do: :ok
  defp bumper(:base, _base), do: "an address from 0 to 255"
  defp bumper(:count, count) when is_integer(count) and count in 0..64, do: :ok
  defp bumper(:count, _count), do: "a whole number from 0 to 64"

  defp bumper(:segments, segments) do
    if whole_list?(segments, 0, 15),
      do: :ok,
      else: "a list of segments, 0 (front) to 15, counter-clockwise"
  end

  defp banks(given) do
    profile = given[:profile]
    sonars = given[:sonar_banks] || eights(length(profile.sonars))
    irs = given[:ir_banks] || eights(length(profile.irs))
    # The pause after each ping that is public for a Magellan; the ATRV mini's has none.
    ping = if profile.name == :magellan, do: 1250, else: 0

    order =
      given[:ir_order] ||
        if(profile.name == :magellan and Enum.sum(irs) == 16,
          do: Infrared.magellan_order(),
          else: Enum.to_list(0..(Enum.sum(irs) - 1)//1)
        )

    Keyword.merge(given,
      sonar_banks: sonars,
      sonar_times: given[:sonar_times] || {30_000, ping, 0},
      ir_banks: irs,
      ir_order: order
    )
  end

  defp eights(0), do: []
  defp eights(n) when n <= 8, do: [n]
  defp eights(n), do: [8 | eights(n - 8)]

  defp fits(_given, false), do: :ok

  defp fits(given, true) do
    for_each = [sonar_banks: given[:profile].sonars, ir_banks: given[:profile].irs]

    Enum.find_value(for_each, :ok, fn {key, poses} ->
      if Enum.sum(given[key]) != length(poses),
        do:
          wrong([key], given[key], "#{length(poses)} together, as many as the body has poses for")
    end)
  end

  defp infrared(given, conversions) do
    count = Enum.sum(given[:ir_banks])

    cond do
      Enum.sort(given[:ir_order]) != Enum.to_list(0..(count - 1)//1) ->
        wrong([:ir_order], given[:ir_order], rule(:ir_order) <> ", of #{count} infrareds")

      wrong = Enum.find([:ir_a, :ir_b], &(not matches?(Map.fetch!(conversions, &1), count))) ->
        wrong(
          [:conversions, wrong],
          Map.fetch!(conversions, wrong),
          "one for each of #{count} infrareds"
        )

      true ->
        :ok
    end
  end

  defp matches?(values, count) when is_list(values), do: length(values) == count
  defp matches?(_one, _count), do: true

  defp all(path, options, check) do
    Enum.find_value(options, :ok, fn {key, value} ->
      with rule when is_binary(rule) <- check.(key, value),
           do: wrong(path ++ [key], value, rule),
           else: (_ok -> nil)
    end)
  end

  defp number?(value, least, most), do: is_number(value) and value >= least and value <= most

  defp whole_list?(list, least, most),
    do: is_list(list) and Enum.all?(list, &(is_integer(&1) and &1 >= least and &1 <= most))

  defp wrong(path, value, rule),
    do: {:error, "rflex option #{words(path)} cannot be #{show(value)}: it must be #{rule}"}

  defp words([]), do: "list"
  defp words(path), do: Enum.map_join(path, " ", &"#{&1}:")

  defp show(value),
    do: inspect(value, limit: 20, printable_limit: 60, width: :infinity, charlists: :as_lists)
end
