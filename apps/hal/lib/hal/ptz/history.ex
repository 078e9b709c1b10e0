defmodule Hal.Ptz.History do
  @moduledoc """
  Estimates where a pan-tilt unit looked at a given time, for cameras that do not know it. Pure.

  A unit reports its direction about ten times a second, a picture is taken some time in between,
  and both arrive late. So the last readings are kept with their times, and `at/2` gives the
  direction at the time of a picture: between two readings, by linear interpolation; after the
  last one, by the speed of the last two for up to 100 ms, then constant, for a second at most. At
  80 degrees/s an error of 50 ms is an error of 4 degrees.
  """

  # Two seconds at 10 Hz.
  @most 20
  @ahead_ms 100
  @good_ms 1_000
  # Two readings that are nearer in time give no speed.
  @least_ms 10

  @typedoc "Newest first."
  @opaque t :: [{at_ms :: integer(), direction()}]
  @type direction :: %{pan: float(), tilt: float(), field_of_view: float()}

  @doc "An empty history."
  @spec new() :: t()
  def new, do: []

  @doc """
  Adds a reading that arrived at `now_ms`; its own `age_ms` says how much older it is. A reading
  that is not newer than the last one is ignored.
  """
  @spec note(t(), map(), integer()) :: t()
  def note(aim, %{pan: pan, tilt: tilt, field_of_view: view} = reading, now_ms) do
    at_ms = now_ms - Map.get(reading, :age_ms, 0)

    case aim do
      [{last_ms, _} | _] when at_ms <= last_ms ->
        aim

      _ ->
        Enum.take([{at_ms, %{pan: pan, tilt: tilt, field_of_view: view}} | aim], @most)
    end
  end

  @doc """
  Where the unit looked at that time; `nil` before the oldest reading, and more than a second
  after the last one.

      iex> looks = fn pan -> %{pan: pan, tilt: 0.0, field_of_view: 0.8} end
      iex> aim = Hal.Ptz.History.new() |> Hal.Ptz.History.note(looks.(0.0), 100) |> Hal.Ptz.History.note(looks.(0.5), 200)
      iex> {Hal.Ptz.History.at(aim, 150).pan, Hal.Ptz.History.at(aim, 220).pan, Hal.Ptz.History.at(aim, 1000).pan}
      {0.25, 0.6, 1.0}
      iex> {Hal.Ptz.History.at(aim, 99), Hal.Ptz.History.at(aim, 1201)}
      {nil, nil}
  """
  @spec at(t(), integer()) :: direction() | nil
  def at([], _at_ms), do: nil

  def at([{last_ms, _} | _], at_ms) when at_ms - last_ms > @good_ms, do: nil

  def at([{last_ms, last}, {before_ms, before} | _], at_ms)
      when at_ms > last_ms and (last_ms - before_ms) in @least_ms..@good_ms//1,
      do: between({before_ms, before}, {last_ms, last}, min(at_ms, last_ms + @ahead_ms))

  def at([{last_ms, last} | _], at_ms) when at_ms >= last_ms, do: last

  def at(aim, at_ms), do: earlier(aim, at_ms)

  defp earlier([later | [{before_ms, _} = before | _]], at_ms) when at_ms >= before_ms,
    do: between(before, later, at_ms)

  defp earlier([_later | rest], at_ms), do: earlier(rest, at_ms)
  defp earlier([], _at_ms), do: nil

  defp between({from_ms, from}, {to_ms, to}, at_ms) do
    share = (at_ms - from_ms) / (to_ms - from_ms)
    # The zoom is not extrapolated: its range is short.
    within = share |> max(0.0) |> min(1.0)

    %{
      pan: from.pan + share * (to.pan - from.pan),
      tilt: from.tilt + share * (to.tilt - from.tilt),
      field_of_view: from.field_of_view + within * (to.field_of_view - from.field_of_view)
    }
  end
end
