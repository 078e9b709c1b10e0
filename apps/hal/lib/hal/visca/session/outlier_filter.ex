defmodule Hal.Visca.Session.OutlierFilter do
  @moduledoc """
  Rejects positions that a camera's head cannot have reached. Pure; the camera's units.

  On a line without checksums a single wrong bit turns one position into another. The head turns
  at 80 degrees/s at most (tilt: 50), so a position further away than it can have moved since the
  last one is doubted, until the next one is about the same.
  """

  # Units per millisecond, with a fifth to spare, and two degrees.
  @pan_rate 80 * 8.8 * 1.2 / 1000
  @tilt_rate 50 * 12 * 1.2 / 1000
  @pan_slack 18
  @tilt_slack 24

  defstruct believed: nil, doubted: nil, doubts: 0

  @type seen :: {pan :: integer(), tilt :: integer(), at_ms :: integer()}
  @typedoc "`doubts` counts the positions that were doubted when they came."
  @type t :: %__MODULE__{
          believed: seen() | nil,
          doubted: seen() | nil,
          doubts: non_neg_integer()
        }

  @doc "A filter that has seen no position."
  @spec new() :: t()
  def new, do: %__MODULE__{}

  @doc """
  Takes a position; returns whether it is believed.

      iex> alias Hal.Visca.Session.OutlierFilter
      iex> {true, outliers} = OutlierFilter.hear(OutlierFilter.new(), {0, 0}, 0)
      iex> {false, outliers} = OutlierFilter.hear(outliers, {256, 0}, 100)
      iex> {believed?, _witness} = OutlierFilter.hear(outliers, {258, 0}, 200)
      iex> believed?
      true
  """
  @spec hear(t(), {integer(), integer()}, integer()) :: {boolean(), t()}
  def hear(%__MODULE__{} = outliers, {pan, tilt}, now_ms) do
    seen = {pan, tilt, now_ms}

    if outliers.believed == nil or near?(outliers.believed, seen) or
         near?(outliers.doubted, seen),
       do: {true, %{outliers | believed: seen, doubted: nil}},
       else: {false, %{outliers | doubted: seen, doubts: outliers.doubts + 1}}
  end

  defp near?(nil, _seen), do: false

  defp near?({pan, tilt, before_ms}, {p, t, at_ms}) do
    ms = at_ms - before_ms
    abs(p - pan) <= @pan_slack + @pan_rate * ms and abs(t - tilt) <= @tilt_slack + @tilt_rate * ms
  end
end
