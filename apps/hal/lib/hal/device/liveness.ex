defmodule Hal.Device.Liveness do
  @moduledoc """
  Decides from a device's readings and the time whether it shows signs of life. Pure, integer
  milliseconds; `Hal.Device` calls it. An open line or a running program proves nothing about the
  device at the other end.

  | device | is online | goes offline |
  |---|---|---|
  | drive | once its base has reported its wheels since the opening, and while it keeps reporting them | by `Hal.Device.Reports`: `:silent`; the driver stays open |
  | camera, lidar | once it has given a picture or blobs, or a scan, since the opening | after 10 s without one: `:mute`; it is reopened |
  | pan-tilt unit | once it has reported where it looks since the opening | when its driver returns an error; after 10 s without a first reading: `:mute`; it is reopened |
  """
  alias Hal.Device.Reports

  @mute_ms 10_000

  @enforce_keys [:kind, :since_ms]
  defstruct @enforce_keys ++ [heard?: false, reports: nil]

  @typedoc """
  `since_ms` is the time of the opening or, except for a drive, of the last reading; `reports` is
  that of a drive.
  """
  @type t :: %__MODULE__{
          kind: Hal.Device.kind(),
          since_ms: integer(),
          heard?: boolean(),
          reports: Reports.t() | nil
        }

  @doc "A device that has just been opened; `sonar?` says whether a drive's base has sonars."
  @spec new(Hal.Device.kind(), sonar? :: boolean(), at_ms :: integer()) :: t()
  def new(:drive, sonar?, at_ms),
    do: %__MODULE__{kind: :drive, since_ms: at_ms, reports: Reports.new(sonar?, at_ms)}

  def new(kind, _sonar?, at_ms) when kind in [:ptz, :camera, :scan],
    do: %__MODULE__{kind: kind, since_ms: at_ms}

  @doc "Takes readings that arrived at this time; an empty list is not a sign of life."
  @spec heard(t(), [term()], at_ms :: integer()) :: t()
  def heard(%__MODULE__{} = signs, [], _at_ms), do: signs

  def heard(%__MODULE__{kind: :drive} = signs, readings, at_ms),
    do: %{signs | reports: Reports.heard(signs.reports, readings, at_ms)}

  def heard(%__MODULE__{} = signs, _readings, at_ms),
    do: %{signs | heard?: true, since_ms: at_ms}

  @doc """
  The condition of the device now; `:waiting` if it was opened recently and nothing has come yet.

      iex> camera = Hal.Device.Liveness.new(:camera, false, 0)
      iex> for at_ms <- [0, 9_999, 10_000], do: Hal.Device.Liveness.judge(camera, at_ms)
      [:waiting, :waiting, {:offline, :mute}]
      iex> camera = Hal.Device.Liveness.heard(camera, [:a_frame], 500)
      iex> for at_ms <- [500, 10_499, 10_500], do: Hal.Device.Liveness.judge(camera, at_ms)
      [:online, :online, {:offline, :mute}]
      iex> head = Hal.Device.Liveness.heard(Hal.Device.Liveness.new(:ptz, false, 0), [:where], 500)
      iex> Hal.Device.Liveness.judge(head, 60_000)
      :online
  """
  @spec judge(t(), at_ms :: integer()) :: :online | :waiting | {:offline, :silent | :mute}
  def judge(%__MODULE__{kind: :drive, reports: reports}, at_ms) do
    case Reports.wheels(reports, at_ms) do
      :fresh -> :online
      :waiting -> :waiting
      :silent -> {:offline, :silent}
    end
  end

  def judge(%__MODULE__{kind: :ptz, heard?: true}, _at_ms), do: :online

  def judge(%__MODULE__{since_ms: since_ms}, at_ms) when at_ms - since_ms >= @mute_ms,
    do: {:offline, :mute}

  def judge(%__MODULE__{heard?: true}, _at_ms), do: :online
  def judge(%__MODULE__{}, _at_ms), do: :waiting

  @doc """
  Whether a drive's wheels may be armed, judged only by its base's reports
  (`Hal.Device.Reports.ready/2`).
  """
  @spec ready(t(), at_ms :: integer()) :: :ok | {:error, line :: String.t()}
  def ready(%__MODULE__{kind: :drive, reports: reports}, at_ms), do: Reports.ready(reports, at_ms)

  @doc """
  When to judge again (ms), if nothing is heard until then.

      iex> Hal.Device.Liveness.next_ms(Hal.Device.Liveness.new(:camera, false, 70), 100)
      10_070
  """
  @spec next_ms(t(), at_ms :: integer()) :: integer()
  def next_ms(%__MODULE__{kind: :drive, reports: reports}, at_ms),
    do: Reports.next_ms(reports, at_ms)

  def next_ms(%__MODULE__{since_ms: since_ms}, at_ms),
    do: if(since_ms + @mute_ms > at_ms, do: since_ms + @mute_ms, else: at_ms + @mute_ms)
end
