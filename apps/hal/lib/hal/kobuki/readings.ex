defmodule Hal.Kobuki.Readings do
  @moduledoc false
  # Turns the parts of a Kobuki's packets into readings. Pure; times are whole milliseconds.
  alias Hal.{Kobuki, SerialBase}
  import Bitwise

  @metres_per_tick 8.5292090e-5
  @wheel_base 0.230
  # What a wheel can do, 0.7 m/s, and the most that turning adds.
  @max_wheel 1.1
  @slip_turn 0.2
  @slip_ms 1_000
  @again_ms 1_000

  @enforce_keys [:odometry, :bumpers]
  defstruct @enforce_keys ++
              [
                last: nil,
                angle: nil,
                firmware: nil,
                drops: 0,
                cliffs: 0,
                slip: {0.0, nil},
                strained_ms: nil,
                malformed: 0
              ]

  @typedoc "`last` is `{time of the base, time of its arrival, angle}` of the last packet, `bumpers` how many the body has round it."
  @type t :: %__MODULE__{}

  @doc "The state before the first packet; `before` is the odometry of the same base, if it continues."
  @spec new(bumpers :: non_neg_integer(), SerialBase.Odometry.t() | nil) :: t()
  def new(bumpers, before) do
    odometry = before || SerialBase.Odometry.new(16, @metres_per_tick, @wheel_base, @max_wheel)

    %__MODULE__{odometry: odometry, bumpers: bumpers}
  end

  @doc "Takes the payload of a packet."
  @spec packet(t(), binary(), integer()) :: {[Hal.Drive.reading()], t()}
  def packet(%__MODULE__{} = senses, payload, at_ms) do
    with {:ok, [_ | _] = parts} <- Kobuki.parts(payload) do
      senses = Enum.reduce(parts, senses, &note/2)

      case List.keyfind(parts, :core, 0) do
        {:core, core} -> core(senses, core, at_ms)
        nil -> {[], senses}
      end
    else
      {:ok, []} -> {[], senses}
      :error -> {[], %{senses | malformed: senses.malformed + 1}}
    end
  end

  defp note({:angle, angle}, senses), do: %{senses | angle: angle}
  defp note({:firmware, version}, senses), do: %{senses | firmware: version}
  defp note({:core, _core}, senses), do: senses

  # The same time stamp twice is the same packet twice.
  defp core(%{last: {time, _, _}} = senses, %{time: time}, _at_ms), do: {[], senses}

  defp core(senses, core, at_ms) do
    senses = %{senses | drops: core.drops, cliffs: core.cliffs}
    turn = turned(senses)
    {odd, senses} = slip(senses, core, turn, at_ms)
    before = with {time, before_ms, _angle} <- senses.last, do: {time, before_ms}
    {elapsed_ms, restarted?} = SerialBase.Odometry.elapsed(before, core.time, at_ms, 16)

    report = %{
      left: core.left,
      right: core.right,
      at_ms: at_ms,
      elapsed_ms: elapsed_ms,
      turn: turn,
      restarted?: restarted?
    }

    {odometry, counted} = SerialBase.Odometry.report(senses.odometry, report)
    senses = %{senses | odometry: counted, last: {core.time, at_ms, senses.angle}}
    {strained, senses} = strained(senses, core.overcurrent, at_ms)
    wheels = if odometry, do: [odometry: odometry], else: []
    {wheels ++ bumpers(senses, core) ++ [power: core.volts] ++ odd ++ strained, senses}
  end

  # The gyro's turn since the last packet. The sheet does not say where its angle wraps, at a half turn or at 16 bits: between
  # two packets the base has turned by the smaller of both.
  defp turned(%{last: {_, _, before}, angle: angle}) when before != nil and angle != nil do
    <<words::signed-16>> = <<angle - before::16>>
    turns = Integer.mod(angle - before + 18_000, 36_000) - 18_000
    Enum.min_by([words, turns], &abs/1) * :math.pi() / 18_000
  end

  defp turned(_no_angle_yet), do: nil

  # Wheels and gyro differ by so much in a second: the wheels slip.
  defp slip(%{odometry: %{last: {left, right, _}}} = senses, core, turn, at_ms)
       when turn != nil do
    <<ticks::signed-16>> = <<core.right - right - (core.left - left)::16>>
    {sum, since_ms} = senses.slip
    sum = sum + ticks * @metres_per_tick / @wheel_base - turn

    cond do
      since_ms == nil ->
        {[], %{senses | slip: {0.0, at_ms}}}

      at_ms - since_ms < @slip_ms ->
        {[], %{senses | slip: {sum, since_ms}}}

      abs(sum) > @slip_turn ->
        {[odd: "wheels and gyro differ: the wheels slip"], %{senses | slip: {0.0, at_ms}}}

      true ->
        {[], %{senses | slip: {0.0, at_ms}}}
    end
  end

  defp slip(senses, _core, _turn, _at_ms), do: {[], senses}

  defp bumpers(%{bumpers: 0}, _core), do: []

  # Switches at the right, in the middle and at the left, 60 degrees apart.
  defp bumpers(%{bumpers: count}, %{bumpers: bits}) do
    sixth = round(count / 6)

    pressed =
      for {bit, segment} <- [{2, 0}, {4, sixth}, {1, rem(count - sixth, count)}],
          (bits &&& bit) != 0,
          do: segment

    [bumpers: Enum.sort(pressed)]
  end

  defp strained(%{strained_ms: nil} = senses, 0, _at_ms), do: {[], senses}
  defp strained(senses, 0, _at_ms), do: {[obeyed: :drive], %{senses | strained_ms: nil}}

  defp strained(%{strained_ms: since_ms} = senses, bits, at_ms) do
    if since_ms == nil or at_ms - since_ms >= @again_ms do
      line = "it has cut the power of its motors: over 3 A (#{sides(bits, 1, 2)})"
      {[{:refused, :drive, line}], %{senses | strained_ms: at_ms}}
    else
      {[], senses}
    end
  end

  @doc "Whether the wheels may turn."
  @spec able(t()) :: :ok | {:error, line :: String.t()}
  def able(%__MODULE__{firmware: nil}), do: {:error, "its firmware's version is not known yet"}

  def able(%__MODULE__{firmware: {major, minor, patch}}) when major != 1,
    do: {:error, "its firmware #{major}.#{minor}.#{patch} speaks another protocol than 1.x"}

  def able(%__MODULE__{drops: drops}) when drops != 0,
    do: {:error, "a wheel hangs in the air (#{sides(drops, 2, 1)}): put it down"}

  def able(%__MODULE__{cliffs: cliffs}) when cliffs != 0,
    do: {:error, "there is no floor before it (#{sides(cliffs, 4, 1)}): take it from there"}

  def able(%__MODULE__{}), do: :ok

  defp sides(bits, left, right) do
    names = [{left, "left"}, {7 - left - right, "middle"}, {right, "right"}]
    for({bit, name} <- names, (bits &&& bit) != 0, do: name) |> Enum.uniq() |> Enum.join(", ")
  end
end
