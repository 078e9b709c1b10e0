defmodule Robot.Host.LoadShedder do
  @moduledoc false
  # Keeps the mailbox of a role to which strangers send small under a flood. A process cannot refuse messages, but it can
  # drop them faster than others send them: looking at a message costs far less than handling it.
  #
  # What the role calls expendable and junk are dropped first, the oldest before newer; then, if there is still too much,
  # the rest and forged system messages. Its tick stays. What is kept keeps its order.

  @most 2_000
  @keep 500

  @doc """
  Drops the oldest messages of the calling process's mailbox if it is too long; returns how many.
  `expendable?` tells which casts are dropped before others.
  """
  @spec relieve(expendable? :: (term() -> boolean())) :: non_neg_integer()
  def relieve(expendable?) do
    case queued() do
      queued when queued > @most -> sweep(queued, expendable?)
      _few -> 0
    end
  end

  # Each message is taken out once, and what stays is sent again: searching past the messages that
  # stay, again and again, would take longer than new ones need to arrive.
  defp sweep(queued, expendable?) do
    {kept, left} = take(queued, queued - @keep, [], expendable?)
    kept = Enum.reverse(kept)
    kept = if length(kept) > @most, do: drop_oldest(kept, left), else: kept
    for message <- kept, do: send(self(), message)
    queued - length(kept)
  end

  # `left` is how many must still be dropped.
  defp take(0, left, kept, _expendable?), do: {kept, left}

  defp take(number, left, kept, expendable?) do
    receive do
      message ->
        if left > 0 and expendable?(message, expendable?),
          do: take(number - 1, left - 1, kept, expendable?),
          else: take(number - 1, left, [message | kept], expendable?)
    end
  end

  defp drop_oldest(kept, 0), do: kept
  defp drop_oldest([], _left), do: []
  defp drop_oldest([:tick | kept], left), do: [:tick | drop_oldest(kept, left)]
  defp drop_oldest([_oldest | kept], left), do: drop_oldest(kept, left - 1)

  # A role calls none, so no answers wait.
  defp expendable?({:"$gen_cast", cast}, expendable?), do: expendable?.(cast)
  defp expendable?(:tick, _expendable?), do: false

  defp expendable?(message, _expendable?) when is_tuple(message) and tuple_size(message) > 0,
    do: elem(message, 0) not in [:system, :DOWN]

  defp expendable?(_junk, _expendable?), do: true

  defp queued do
    {:message_queue_len, queued} = Process.info(self(), :message_queue_len)
    queued
  end
end
