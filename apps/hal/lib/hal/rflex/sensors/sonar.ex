defmodule Hal.RFlex.Sensors.Sonar do
  @moduledoc """
  Collects the ranges of the sonars from reports that may each contain only some of them. Pure.

  Every board (bank) numbers its inputs from a multiple of `stride`, whether fitted or not; the
  sonars are counted bank after bank, in the order of the profile's poses. Ids that no bank has
  are counted and ignored. A range is within the profile's least and greatest; without an echo the
  controller reports a very large number, which gives the greatest range. With an `age` above 1 a
  range is the least of that many readings.

  There are ranges once every sonar has been heard, and while none is older than 2 s and the
  newest is not older than 1 s, some four rounds. A sonar that has gone silent does not mean a
  free path; and the shorter limit for the newest one shows sooner that all boards are silent, and
  not just that a few reports were damaged.
  """

  @oldest_ms 2_000
  @silent_ms 1_000

  @enforce_keys [:indices, :count, :age, :units, :least, :greatest]
  defstruct @enforce_keys ++ [readings: %{}, unknown: 0]

  @type t :: %__MODULE__{
          indices: %{byte() => non_neg_integer()},
          count: non_neg_integer(),
          age: pos_integer(),
          units: float(),
          least: float(),
          greatest: float(),
          readings: %{non_neg_integer() => {integer(), [float()]}},
          unknown: non_neg_integer()
        }

  @doc """
  `banks` says how many are fitted on each board; `units` are per metre; `least` and `greatest`
  are in metres.
  """
  @spec new([non_neg_integer()], pos_integer(), pos_integer(), float(), float(), float()) :: t()
  def new(banks, stride, age, units, least, greatest) do
    ids = for {n, bank} <- Enum.with_index(banks), slot <- 0..(n - 1)//1, do: bank * stride + slot

    %__MODULE__{
      indices: ids |> Enum.with_index() |> Map.new(),
      count: Enum.sum(banks),
      age: age,
      units: units,
      least: least,
      greatest: greatest
    }
  end

  @doc "Takes the records of a report."
  @spec report(t(), [{byte(), non_neg_integer()}], integer()) :: t()
  def report(%__MODULE__{} = sonar, records, at_ms),
    do: Enum.reduce(records, sonar, &hear(&1, &2, at_ms))

  defp hear({id, raw}, sonar, at_ms) do
    case sonar.indices do
      %{^id => index} ->
        range = (raw / sonar.units) |> max(sonar.least) |> min(sonar.greatest)
        {_at_ms, before} = Map.get(sonar.readings, index, {at_ms, []})
        reading = {at_ms, Enum.take([range | before], sonar.age)}
        %{sonar | readings: Map.put(sonar.readings, index, reading)}

      _unknown ->
        %{sonar | unknown: sonar.unknown + 1}
    end
  end

  @doc """
  The ranges in metres, or `nil` while one is missing or too old.

      iex> sonar = Hal.RFlex.Sensors.Sonar.new([1, 1], 16, 1, 1474.0, 0.15, 5.1)
      iex> sonar = Hal.RFlex.Sensors.Sonar.report(sonar, [{0, 1474}], 0)
      iex> Hal.RFlex.Sensors.Sonar.ranges(sonar, 0)
      nil
      iex> sonar |> Hal.RFlex.Sensors.Sonar.report([{16, 0x7FFF}], 90) |> Hal.RFlex.Sensors.Sonar.ranges(100)
      [1.0, 5.1]
  """
  @spec ranges(t(), integer()) :: [float()] | nil
  def ranges(%__MODULE__{count: count, readings: readings}, at_ms)
      when count > 0 and map_size(readings) == count do
    heard = for index <- 0..(count - 1), do: readings[index]

    {oldest_ms, newest_ms} = heard |> Enum.map(&elem(&1, 0)) |> Enum.min_max()

    if at_ms - oldest_ms <= @oldest_ms and at_ms - newest_ms <= @silent_ms,
      do: for({_, values} <- heard, do: Enum.min(values))
  end

  def ranges(%__MODULE__{}, _at_ms), do: nil
end
