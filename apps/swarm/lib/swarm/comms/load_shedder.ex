defmodule Swarm.Comms.LoadShedder do
  @moduledoc false
  # Keeps the mailbox of a robot's comms process small under a flood. A process cannot refuse messages, but it can
  # drop them faster than others send them: looking at a message costs far less than handling it.
  #
  # Telemetry (messages from other robots) and junk are dropped first, the oldest before newer;
  # then, if there is still too much, commands, the mission's own letters and forged system
  # messages, if anybody sends so many. Timers stay. The rest keeps its order.

  @most 2_000
  @keep 500

  @orders [:command, :say, :rival, :stamp]

  @doc """
  Drops the oldest messages of the calling process's mailbox if it is too long; returns how many.
  `timers` are the messages that stay in any case.
  """
  @spec relieve(timers :: [term()]) :: non_neg_integer()
  def relieve(timers) do
    case queued() do
      queued when queued > @most -> sweep(queued, timers)
      _few -> 0
    end
  end

  # Each message is taken out once, and what stays is sent again: searching past the messages that
  # stay, again and again, would take longer than new ones need to arrive.
  defp sweep(queued, timers) do
    {kept, left} = take(queued, queued - @keep, [], timers)
    kept = Enum.reverse(kept)
    kept = if length(kept) > @most, do: drop_oldest(kept, left, timers), else: kept
    for message <- kept, do: send(self(), message)
    queued - length(kept)
  end

  # `left` is how many must still be dropped.
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

  # Nobody calls a comms process, and answers to its own calls arrive only while it waits for
  # them.
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
