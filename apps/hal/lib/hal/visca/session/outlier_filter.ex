defmodule Hal.Visca.Session.OutlierFilter do
  @moduledoc """
  Rejects positions that a camera's head cannot have reached. Pure; the camera's units.

  A line without checksums turns one position into another by a single bit. The head turns at most
  by 80 degrees/s (tilt: 50), so a position beyond what it can have reached since the last one is
  doubted until the next one says about the same.
  """

  # Units a millisecond, with a fifth to spare, and two degrees.
  @pan_rate 80 * 8.8 * 1.2 / 1000
  @tilt_rate 50 * 12 * 1.2 / 1000
  @pan_slack 18
  @tilt_slack 24

  defstruct believed: nil, doubted: nil, doubts: 0

  @type seen :: {pan :: integer(), tilt :: integer(), at_ms :: integer()}
  @typedoc "`doubts`: how many positions were not believed when they came."
  @type t :: %__MODULE__{
          believed: seen() | nil,
          doubted: seen() | nil,
          doubts: non_neg_integer()
        }

  @doc "Has seen nothing."
  @spec new() :: t()
  def new, do: %__MODULE__{}

  @doc """
  Whether a position is believed.

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
