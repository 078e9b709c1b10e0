defmodule Hal.Device.Publisher do
  @moduledoc false
  # Publishes what a device reports: its readings to its sinks, and each change of its health and
  # arming, once, to sinks and events. Makes no decisions.
  alias Hal.Event
  alias Hal.Device.Arming
  alias Hal.Device.{Obedience, State, Explanation}

  @doc "Passes a reading to all sinks."
  @spec hand_on(State.t(), tuple()) :: :ok
  def hand_on(s, reading) do
    Enum.each(s.sinks, fn {m, f, a} -> apply(m, f, a ++ [reading]) end)
  end

  @doc "Publishes the health of the device, if it has changed."
  @spec health(State.t(), :online | {:offline, reason :: term()}) :: State.t()
  def health(%{health: {condition, _since}} = s, condition), do: s

  def health(s, condition) do
    at_ms = State.now(s)
    health = {condition, since(s.health, condition, at_ms)}
    hand_on(s, {:health, s.device, health})

    {name, about} = change(s, condition)
    event(s, name, at_ms, about)
    %{s | health: health}
  end

  defp change(s, :online), do: {:online, %{again?: s.health != nil}}

  defp change(s, {:offline, reason}),
    do: {:offline, %{reason: reason, line: words(s, reason)}}

  # A new reason to be offline does not restart the time.
  defp since({{:offline, _}, since_ms}, {:offline, _}, _at_ms), do: since_ms
  defp since(_before, _condition, at_ms), do: at_ms

  @doc "Publishes the arming of a drive, if it has changed."
  @spec arming(State.t()) :: State.t()
  def arming(%{arming: %{state: state, why: why}, armed_as: {state, why}} = s), do: s
  def arming(%{kind: kind} = s) when kind != :drive, do: s

  def arming(%{arming: %{state: state, why: why}} = s) do
    reading = %{state: state, why: why}
    {was, _why} = s.armed_as || {:disarmed, nil}
    event(s, :arming, State.now(s), Map.merge(reading, %{was: was, line: lost(s, state)}))
    hand_on(s, {:arming, reading})
    %{s | armed_as: {state, why}}
  end

  defp lost(s, {:error, reason}), do: words(s, reason)
  defp lost(_s, _not_lost), do: nil

  @doc """
  Publishes that the device crashed: it is offline (`:fell`), and a drive is disarmed. Its driver
  has been closed, or its line has ended with the process.
  """
  @spec fallen(State.t()) :: State.t()
  def fallen(s) do
    s = health(s, {:offline, :fell})
    line = words(s, :fell)
    if s.arming, do: arming(%{s | arming: Arming.ready(s.arming, {:error, line})}), else: s
  end

  @doc "Emits an event: a speed came for wheels that are not armed."
  @spec refused(State.t(), Arming.t()) :: :ok
  def refused(s, %{refused: refused}) do
    measured = %{at_ms: State.now(s), refused: refused}
    Event.execute([:hal, :device, :refused], measured, about(s))
  end

  @doc "Emits an event: the device refused a request."
  @spec refusal(State.t(), Obedience.request(), Obedience.refusal()) :: :ok
  def refusal(s, request, %{count: count, line: line}) do
    measured = %{at_ms: State.now(s), count: count}
    about = Map.merge(about(s), %{request: request, line: line})
    Event.execute([:hal, :device, :refusal], measured, about)
  end

  @doc "Emits an event, once for each line: something about the device is odd."
  @spec odd(State.t(), line :: String.t()) :: State.t()
  def odd(%{odd: line} = s, line), do: s

  def odd(s, line) do
    event(s, :odd, State.now(s), %{line: line})
    %{s | odd: line}
  end

  @doc "Emits an event: the watchdog stops the wheels."
  @spec watchdog(State.t()) :: :ok
  def watchdog(s), do: event(s, :watchdog, State.now(s), %{})

  @doc "A reason to be offline, in the words of the driver."
  @spec words(State.t(), reason :: term()) :: String.t()
  def words(s, reason), do: Explanation.offline({s.driver, s.options}, reason)

  defp event(s, name, at_ms, more),
    do: Event.execute([:hal, :device, name], %{at_ms: at_ms}, Map.merge(about(s), more))

  defp about(s), do: Map.merge(s.about, %{device: s.device, driver: s.driver})
end
