defmodule Swarm.Link.Flood do
  @moduledoc """
  Keeps the mailbox of a link small, whatever is poured into it. A process cannot refuse messages,
  but it can throw them away faster than others send them: a look at one costs far less than its
  handling.

  What goes first is telemetry (what is heard by radio) and junk, the oldest of it; then, of what is
  left, commands and the mission's own letters, if anybody sends so many. Timers and what holds
  processes together stay.
  """

  @most 2_000
  @keep 500

  @orders [:command, :say, :rival, :stamp]
  @system [:"$gen_cast", :"$gen_call", :system, :DOWN, :EXIT]

  defguardp is_order(cast)
            when is_tuple(cast) and tuple_size(cast) > 1 and elem(cast, 0) in @orders

  # A pair of a reference and something answers a call.
  defguardp is_needed(message)
            when message in [:tick, :enter] or
                   (is_tuple(message) and tuple_size(message) > 0 and
                      (elem(message, 0) in @system or is_reference(elem(message, 0))))

  @doc "Throws away the oldest of the calling process's mailbox if it is too long; returns how many."
  @spec relieve() :: non_neg_integer()
  def relieve do
    case queued() do
      queued when queued > @most -> telemetry(queued - @keep, 0)
      _few -> 0
    end
  end

  defp telemetry(0, dropped), do: dropped

  defp telemetry(left, dropped) do
    receive do
      {:"$gen_cast", cast} when not is_order(cast) -> telemetry(left - 1, dropped + 1)
      message when not is_needed(message) -> telemetry(left - 1, dropped + 1)
    after
      0 -> if queued() > @most, do: orders(left, dropped), else: dropped
    end
  end

  defp orders(0, dropped), do: dropped

  defp orders(left, dropped) do
    receive do
      {:"$gen_cast", _order} -> orders(left - 1, dropped + 1)
    after
      0 -> dropped
    end
  end

  defp queued do
    {:message_queue_len, queued} = Process.info(self(), :message_queue_len)
    queued
  end
end
