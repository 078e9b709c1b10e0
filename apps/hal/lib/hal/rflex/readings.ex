defmodule Hal.RFlex.Readings do
  @moduledoc false
  # Converts the controller's packets to readings in our units. Pure; the time of arrival is passed
  # in, as integer milliseconds.
  import Bitwise, only: [band: 2]
  alias Hal.RFlex.Options
  alias Hal.RFlex.Protocol.{Packet, Report}
  alias Hal.RFlex.Sensors.{Bumpers, IndexSwitch, Infrared, Odometry, Sonar}

  @most_volts 60.0

  @enforce_keys [:odometry, :sonar, :infrared, :bumpers, :home_address, :power_offset, :ratios]
  defstruct @enforce_keys ++
              [
                frame: nil,
                home: %IndexSwitch{},
                brake: nil,
                motor_ms: nil,
                paired?: false,
                counts: %{}
              ]

  @typedoc """
  `ratios` are those of the joystick, m/s and rad/s a count. `frame` is that of the odometry; `paired?` says whether both wheel counters have been heard;
  `counts` counts packets that were `unknown`, `malformed`, or `implausible`.
  """
  @type t :: %__MODULE__{}

  @doc """
  The state for these options; `before` is the odometry of the same base in the same `frame`, if
  it continues.
  """
  @spec new(Options.t(), Odometry.t() | nil, frame :: reference() | nil) :: t()
  def new(%Options{} = options, before \\ nil, frame \\ nil) do
    %__MODULE__{
      frame: frame,
      odometry: before || odometry(options),
      sonar: sonar(options),
      infrared: infrared(options),
      bumpers: options.bumpers,
      home_address: options.home,
      power_offset: options.power_offset,
      ratios: options.joystick_ratios
    }
  end

  @doc "Takes a packet, and returns the readings that it gives."
  @spec packet(t(), Packet.t(), integer()) :: {[Hal.Drive.reading()], t()}
  def packet(%__MODULE__{} = senses, %Packet{} = packet, at_ms) do
    case Report.decode(packet) do
      {:axis, report} -> axis(%{senses | motor_ms: at_ms}, report, at_ms)
      {:sonar, records} -> sonar(senses, records, at_ms)
      {:infrared, banks} -> infrared(senses, banks)
      {:input, address, state} -> input(senses, address, state)
      {:status, centivolts, brake} -> status(senses, centivolts, brake)
      {:joystick, x, y, buttons} -> {[joystick(senses, x, y, buttons)], senses}
      {:screen, _row, _bytes} -> {[], senses}
      other -> {[], count(senses, other)}
    end
  end

  @doc "How often a wheel counter has jumped, so that it is unknown how far the robot went."
  @spec jumps(t()) :: non_neg_integer()
  def jumps(%__MODULE__{odometry: nil}), do: 0
  def jumps(%__MODULE__{odometry: %Odometry{jumps: jumps}}), do: jumps

  @doc "Puts odometry into another frame, both in the readings and in the state."
  @spec reframe([Hal.Drive.reading()], t(), reference()) :: {[Hal.Drive.reading()], t()}
  def reframe(readings, %__MODULE__{} = senses, frame) do
    readings =
      Enum.map(readings, fn
        {:odometry, odometry} -> {:odometry, %{odometry | frame: frame}}
        other -> other
      end)

    {readings, %{senses | frame: frame}}
  end

  @doc """
  Readings that still apply and should not become stale: those of bumpers, which are reported only
  when they change.
  """
  @spec standing(t()) :: [Hal.Drive.reading()]
  def standing(%__MODULE__{} = senses), do: pressed(senses)

  @doc "What was counted since the start, by kind."
  @spec counts(t()) :: map()
  def counts(%__MODULE__{} = senses) do
    odometry = if senses.odometry, do: Map.take(senses.odometry, [:dropped, :jumps]), else: %{}
    unknown = if senses.sonar, do: %{sonar_ids: senses.sonar.unknown}, else: %{}
    senses.counts |> Map.merge(odometry) |> Map.merge(unknown)
  end

  defp axis(%{odometry: nil} = senses, _report, _at_ms), do: {[{:report, :wheels}], senses}

  defp axis(senses, report, at_ms) do
    case Odometry.report(senses.odometry, report, at_ms) do
      {nil, odometry} ->
        believed? = odometry.dropped == senses.odometry.dropped
        {half(senses.paired? and believed?), %{senses | odometry: odometry}}

      {reading, odometry} ->
        senses = %{senses | odometry: odometry, paired?: true}
        {[{:odometry, %{reading | frame: senses.frame}}], senses}
    end
  end

  # Half of a pair, whose other half may come or be lost: once a pair was heard, half of one is a
  # sign of the base.
  defp half(true), do: [{:report, :wheels}]
  defp half(false), do: []

  defp sonar(%{sonar: nil} = senses, _records, _at_ms), do: {[{:report, :sonar}], senses}

  defp sonar(senses, records, at_ms) do
    senses = %{senses | sonar: Sonar.report(senses.sonar, records, at_ms)}
    {ranges(senses, at_ms), senses}
  end

  defp ranges(%{sonar: sonar}, at_ms) do
    case Sonar.ranges(sonar, at_ms) do
      nil -> []
      ranges -> [{:sonar, ranges}]
    end
  end

  defp infrared(%{infrared: nil} = senses, _banks), do: {[], senses}

  defp infrared(senses, banks) do
    case Infrared.ranges(senses.infrared, banks) do
      nil -> {[], count(senses, :malformed)}
      ranges -> {[{:ir, ranges}], senses}
    end
  end

  defp input(%{home_address: address} = senses, address, _state) when address != nil do
    heading = if senses.odometry, do: senses.odometry.pose.heading, else: 0.0
    home = IndexSwitch.event(senses.home, heading)
    reading = if home.heading, do: [{:home, home.heading}], else: []
    {reading, %{senses | home: home}}
  end

  defp input(senses, address, state) do
    case Bumpers.report(senses.bumpers, address, state) do
      {:ok, bumpers} ->
        senses = %{senses | bumpers: bumpers}
        {pressed(senses), senses}

      :other ->
        {[], count(senses, :unknown)}
    end
  end

  defp pressed(%{bumpers: %{count: 0}}), do: []
  # Not before the controller's first report.
  defp pressed(%{bumpers: %{states: states}}) when states == %{}, do: []
  defp pressed(%{bumpers: bumpers}), do: [{:bumpers, Bumpers.pressed(bumpers)}]

  defp status(senses, centivolts, brake) do
    volts = centivolts / 100 + senses.power_offset

    if volts <= @most_volts,
      do: {[{:power, volts}, {:brake, brake != 0}], %{senses | brake: brake != 0}},
      else: {[], count(senses, :implausible)}
  end

  # Its first button is the dead man's. Only the robot knows what is too fast.
  defp joystick(%{ratios: {ahead, left}}, x, y, buttons) do
    twist = Hal.Twist.new(y * ahead, x * left)
    {:joystick, %{twist: twist, held?: band(buttons, 1) == 1}}
  end

  defp count(senses, what),
    do: %{senses | counts: Map.update(senses.counts, what, 1, &(&1 + 1))}

  defp odometry(%{conversions: %{distance: distance, angle: angle}} = options)
       when distance != nil and angle != nil,
       do:
         Odometry.new(
           distance,
           angle,
           options.limits.max_linear,
           options.limits.max_turn,
           {options.profile.wheel_base, options.conversions.wheel_ratio}
         )

  defp odometry(_options), do: nil

  defp sonar(%{conversions: %{range: range}} = options) when range != nil do
    %{sonar_min: least, sonar_max: greatest} = options.profile

    Sonar.new(
      options.sonar_banks,
      options.sonar_stride,
      options.sonar_age,
      range,
      least,
      greatest
    )
  end

  defp sonar(_options), do: nil

  defp infrared(%{conversions: %{ir_a: a, ir_b: b}, ir_banks: [_ | _]} = options)
       when a != nil and b != nil do
    count = Enum.sum(options.ir_banks)

    %Infrared{
      banks: options.ir_banks,
      base: options.ir_base_bank,
      order: options.ir_order,
      laws: Enum.zip(each(a, count), each(b, count)),
      law: options.ir_law,
      least: options.ir_min,
      greatest: options.profile.ir_max
    }
  end

  defp infrared(_options), do: nil

  defp each(values, _count) when is_list(values), do: values
  defp each(value, count), do: List.duplicate(value, count)
end
