defmodule Hal.Visca.Session.OutlierFilter do
  @moduledoc false
  # Rejects positions that a camera's head cannot have reached. Pure; the camera's units.
  #
  # On a line without checksums a single wrong bit turns one position into another. The head turns
  # at 80 degrees/s at most (tilt: 50; other models: `Hal.Visca.Model`), so a position further away
  # than it can have moved since the last one is doubted, until the next one is about the same.
  alias Hal.Visca.Model

  @enforce_keys [:pan, :tilt]
  defstruct @enforce_keys ++ [believed: nil, doubted: nil, doubts: 0]

  @type seen :: {pan :: integer(), tilt :: integer(), at_ms :: integer()}
  @typedoc """
  `doubts` counts the positions that were doubted when they came; `pan` and `tilt` are what is
  allowed, `{units per ms, units}`.
  """
  @type t :: %__MODULE__{
          pan: {float(), float()},
          tilt: {float(), float()},
          believed: seen() | nil,
          doubted: seen() | nil,
          doubts: non_neg_integer()
        }

  @doc "A filter that has seen no position of a camera of this model."
  @spec new(Model.t()) :: t()
  def new(model \\ Model.get(:d30)) do
    %__MODULE__{
      pan: allowed(model.pan_rate, model.pan_degree),
      tilt: allowed(model.tilt_rate, model.tilt_degree)
    }
  end

  # With a fifth to spare, and two degrees.
  defp allowed(rate, degree), do: {rate * degree * 1.2 / 1000, 2 * degree}

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

    if outliers.believed == nil or near?(outliers, outliers.believed, seen) or
         near?(outliers, outliers.doubted, seen),
       do: {true, %{outliers | believed: seen, doubted: nil}},
       else: {false, %{outliers | doubted: seen, doubts: outliers.doubts + 1}}
  end

  defp near?(_outliers, nil, _seen), do: false

  defp near?(%{pan: pans, tilt: tilts}, {pan, tilt, before_ms}, {p, t, at_ms}) do
    ms = at_ms - before_ms
    abs(p - pan) <= most(pans, ms) and abs(t - tilt) <= most(tilts, ms)
  end

  defp most({rate, slack}, ms), do: slack + rate * ms
end
