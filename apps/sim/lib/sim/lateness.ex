defmodule Sim.Lateness do
  @moduledoc """
  Estimates the delay of messages between two unsynchronised clocks, relative to the fastest
  message so far. Pure; times in milliseconds.

  Messages that were held up on their way, for example because the process was frozen, arrive all
  at once, and are old by then. The shortest delay is forgotten slowly, by 1 ms in 20 messages, so
  that clocks may drift.
  """

  @late_ms 300
  @leak_ms 0.05

  @typedoc "The smallest difference of the two clocks so far, or `nil` before the first message."
  @type t :: float() | nil

  @doc """
  Whether a message is too old that was sent at `sent_ms` by the sender's clock and is read at
  `now_ms` by ours.

      iex> {false, least} = Sim.Lateness.late?(nil, 1_000, 5_000)
      iex> {false, least} = Sim.Lateness.late?(least, 1_050, 5_060)
      iex> {late?, _least} = Sim.Lateness.late?(least, 1_100, 5_700)
      iex> late?
      true
  """
  @spec late?(t(), sent_ms :: integer(), now_ms :: integer()) :: {boolean(), t()}
  def late?(nil, sent_ms, now_ms), do: {false, (now_ms - sent_ms) * 1.0}

  def late?(least, sent_ms, now_ms) do
    least = min(least + @leak_ms, (now_ms - sent_ms) * 1.0)
    {now_ms - sent_ms - least > @late_ms, least}
  end
end
