defmodule Hal.Device.Reports do
  @moduledoc """
  Decides from a base's reports and the time whether a robot has what it needs to drive. Pure,
  integer milliseconds; `Hal.Device` calls it. An open line proves nothing: a base is present once
  it has reported its wheels.

  | no report | for | then |
  |---|---|---|
  | of the wheels | since the line was opened | not online, not armed |
  | of the wheels | 500 ms | offline (`:silent`), stopped and disarmed |
  | of the sonars, where the base has any | since the line was opened | not armed |
  | of the sonars, where the base has any | 2 s | stopped and disarmed |

  Between 500 ms and 2 s without sonar reports the robot drives slowly (`:blind` of
  `Robot.Safety.Reflex`).

  Odometry counts as a report of the wheels, ranges as one of the sonars. So do
  `{:report, :wheels}` and `{:report, :sonar}`, from a driver that receives a report but cannot
  make a reading of it yet.
  """

  @wheels_ms 500
  @sonar_ms 2_000

  @enforce_keys [:sonar?, :opened_ms]
  defstruct @enforce_keys ++ [wheels_ms: nil, sonar_ms: nil]

  @typedoc "When the line was opened, and when wheels and sonars last reported since then."
  @type t :: %__MODULE__{
          sonar?: boolean(),
          opened_ms: integer(),
          wheels_ms: integer() | nil,
          sonar_ms: integer() | nil
        }

  @doc """
  The state for a line that has just been opened; `sonar?` says whether its base has sonars.
  """
  @spec new(sonar? :: boolean(), at_ms :: integer()) :: t()
  def new(sonar?, at_ms) when is_boolean(sonar?),
    do: %__MODULE__{sonar?: sonar?, opened_ms: at_ms}

  @doc "Takes readings that arrived at this time."
  @spec heard(t(), [Hal.Drive.reading() | term()], at_ms :: integer()) :: t()
  def heard(%__MODULE__{} = reports, readings, at_ms),
    do: Enum.reduce(readings, reports, &note(&2, &1, at_ms))

  defp note(reports, {:odometry, _odometry}, at_ms), do: %{reports | wheels_ms: at_ms}
  defp note(reports, {:report, :wheels}, at_ms), do: %{reports | wheels_ms: at_ms}
  defp note(reports, {:sonar, _ranges}, at_ms), do: %{reports | sonar_ms: at_ms}
  defp note(reports, {:report, :sonar}, at_ms), do: %{reports | sonar_ms: at_ms}
  defp note(reports, _other, _at_ms), do: reports

  @doc """
  Whether the base reports its wheels: `:fresh`; `:waiting`, if the line was opened recently;
  `:silent`.

      iex> reports = Hal.Device.Reports.new(false, 0)
      iex> for at_ms <- [0, 499, 500], do: Hal.Device.Reports.wheels(reports, at_ms)
      [:waiting, :waiting, :silent]
      iex> reports = Hal.Device.Reports.heard(reports, [report: :wheels], 700)
      iex> for at_ms <- [700, 1199, 1200], do: Hal.Device.Reports.wheels(reports, at_ms)
      [:fresh, :fresh, :silent]
  """
  @spec wheels(t(), at_ms :: integer()) :: :fresh | :waiting | :silent
  def wheels(%__MODULE__{wheels_ms: nil, opened_ms: opened_ms}, at_ms),
    do: if(at_ms - opened_ms < @wheels_ms, do: :waiting, else: :silent)

  def wheels(%__MODULE__{wheels_ms: wheels_ms}, at_ms),
    do: if(at_ms - wheels_ms < @wheels_ms, do: :fresh, else: :silent)

  @doc """
  Whether the wheels may be armed, judged only by the reports; the error says what is missing.

      iex> reports = Hal.Device.Reports.new(true, 0)
      iex> Hal.Device.Reports.ready(reports, 100)
      {:error, "its base has not reported its wheels yet"}
      iex> reports = Hal.Device.Reports.heard(reports, [report: :wheels], 100)
      iex> Hal.Device.Reports.ready(reports, 100)
      {:error, "its base has not reported its sonars yet"}
      iex> reports = Hal.Device.Reports.heard(reports, [report: :sonar], 200)
      iex> Hal.Device.Reports.ready(reports, 200)
      :ok
      iex> Hal.Device.Reports.ready(reports, 700)
      {:error, "its base reports nothing of its wheels"}
  """
  @spec ready(t(), at_ms :: integer()) :: :ok | {:error, line :: String.t()}
  def ready(%__MODULE__{} = reports, at_ms) do
    case wheels(reports, at_ms) do
      :fresh -> sonar(reports, at_ms)
      _stale when reports.wheels_ms == nil -> missing("has not reported its wheels yet")
      :silent -> missing("reports nothing of its wheels")
    end
  end

  defp sonar(%{sonar?: false}, _at_ms), do: :ok
  defp sonar(%{sonar_ms: nil}, _at_ms), do: missing("has not reported its sonars yet")

  defp sonar(%{sonar_ms: sonar_ms}, at_ms),
    do: if(at_ms - sonar_ms < @sonar_ms, do: :ok, else: missing("reports nothing of its sonars"))

  defp missing(what), do: {:error, "its base #{what}"}

  @doc """
  When to judge again (ms), if nothing is heard until then: what is fresh now may be stale by
  then.

      iex> reports = Hal.Device.Reports.new(true, 0) |> Hal.Device.Reports.heard([report: :wheels, report: :sonar], 100)
      iex> for at_ms <- [100, 600, 2100], do: Hal.Device.Reports.next_ms(reports, at_ms)
      [600, 1100, 2600]
  """
  @spec next_ms(t(), at_ms :: integer()) :: integer()
  def next_ms(%__MODULE__{} = reports, at_ms) do
    wheels_ms = (reports.wheels_ms || reports.opened_ms) + @wheels_ms
    sonar_ms = if reports.sonar?, do: (reports.sonar_ms || at_ms) + @sonar_ms, else: wheels_ms

    [wheels_ms, sonar_ms]
    |> Enum.filter(&(&1 > at_ms))
    |> Enum.min(fn -> at_ms + @wheels_ms end)
    |> min(at_ms + @wheels_ms)
  end
end
