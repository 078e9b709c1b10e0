defmodule Hal.Device.Confirmation do
  @moduledoc """
  Answers callers that wait to hear whether what a drive was told has a base behind it (`Hal.Device.confirm/3`). Runs in
  the device's process.

  A line that is open and takes bytes proves nothing: its program may be frozen, its cable cut. The next report of the
  wheels does.
  """
  alias Hal.Device.State

  @typedoc "What is applied, with the outcome as its last argument."
  @type reply :: {module(), atom(), list()}

  @typedoc """
  `:reported`: the base has reported its wheels since it was asked; `:silent`: it has not, for as long as was asked;
  `:closed`: the driver is not open.
  """
  @type outcome :: :reported | :silent | :closed

  @doc "Waits for the next report, so long at most; a message `{:unconfirmed, ref}` says that none came."
  @spec ask(State.t(), within_ms :: pos_integer(), reply()) :: State.t()
  def ask(%{inner: {:open, _}} = s, within_ms, reply) do
    ref = make_ref()
    timer = Process.send_after(self(), {:unconfirmed, ref}, within_ms)
    %{s | confirmations: Map.put(s.confirmations, ref, {timer, reply})}
  end

  def ask(s, _within_ms, reply) do
    answer(reply, :closed)
    s
  end

  @doc "Takes readings: a report of the wheels answers all that wait."
  @spec heard(State.t(), [term()]) :: State.t()
  def heard(%{confirmations: none} = s, _readings) when none == %{}, do: s

  def heard(s, readings) do
    report? = &(match?({:odometry, _odometry}, &1) or &1 == {:report, :wheels})
    if Enum.any?(readings, report?), do: all(s, :reported), else: s
  end

  @doc "The driver was closed."
  @spec closed(State.t()) :: State.t()
  def closed(s), do: all(s, :closed)

  @doc "The time of one of them is over."
  @spec late(State.t(), reference()) :: State.t()
  def late(s, ref) do
    {waiting, confirmations} = Map.pop(s.confirmations, ref)
    with {_timer, reply} <- waiting, do: answer(reply, :silent)
    %{s | confirmations: confirmations}
  end

  defp all(s, outcome) do
    for {_ref, {timer, reply}} <- s.confirmations do
      Process.cancel_timer(timer)
      answer(reply, outcome)
    end

    %{s | confirmations: %{}}
  end

  defp answer({m, f, a}, outcome), do: apply(m, f, a ++ [outcome])
end
