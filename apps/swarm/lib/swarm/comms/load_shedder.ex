defmodule Swarm.Comms.LoadShedder do
  @moduledoc """
  Keeps the mailbox of a robot's comms process small under a flood. A process cannot refuse messages, but it can
  drop them faster than others send them: looking at a message costs far less than handling it.

  What goes first is telemetry (what is heard by radio) and junk, the oldest of it; then, if what is left
  is still too much, commands, the mission's own letters and forged messages of the system, if
  anybody sends so many. Timers stay. The order of what stays is kept.
  """

  @most 2_000
  @keep 500

  @orders [:command, :say, :rival, :stamp]

  @doc """
  Throws away the oldest of the calling process's mailbox if it is too long; returns how many. `timers`
  are the messages that stay in any case.
  """
  @spec relieve(timers :: [term()]) :: non_neg_integer()
  def relieve(timers) do
    case queued() do
      queued when queued > @most -> sweep(queued, timers)
      _few -> 0
    end
  end

  # Each message is taken out once, and what stays is sent again: to leave it where it is, and look for the
  # others behind it again and again, would take longer than they need to come.
  defp sweep(queued, timers) do
    {kept, left} = take(queued, queued - @keep, [], timers)
    kept = Enum.reverse(kept)
    kept = if length(kept) > @most, do: drop_oldest(kept, left, timers), else: kept
    for message <- kept, do: send(self(), message)
    queued - length(kept)
  end

  # `left` is how many are still to go.
  defp take(0, left, kept, _timers), do: {kept, left}

  defp take(number, left, kept, timers) do
    receive do
      message ->
        if left > 0 and telemetry?(message) and message not in timers,
          do: take(number - 1, left - 1, kept, timers),
          else: take(number - 1, left, [message | kept], timers)
    end
  end

  defp drop_oldest(kept, 0, _timers), do: kept
  defp drop_oldest([], _left, _timers), do: []

  defp drop_oldest([oldest | kept], left, timers) do
    if oldest in timers,
      do: [oldest | drop_oldest(kept, left, timers)],
      else: drop_oldest(kept, left - 1, timers)
  end

  # Nobody calls a comms process, and no answer to a call of its own comes when nobody waits for it.
  defp telemetry?({:"$gen_cast", cast}),
    do: not (is_tuple(cast) and tuple_size(cast) > 1 and elem(cast, 0) in @orders)

  defp telemetry?(message) when is_tuple(message) and tuple_size(message) > 0,
    do: elem(message, 0) not in [:system, :DOWN]

  defp telemetry?(_junk), do: true

  defp queued do
    {:message_queue_len, queued} = Process.info(self(), :message_queue_len)
    queued
  end
end
