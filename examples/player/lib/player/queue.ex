defmodule Player.Queue do
  @moduledoc """
  Holds what waits for a client of Player's protocol, and decides what it gets when. Pure.

  In PUSH all goes out at once. In PULL data waits until the client asks for a round: then all that waits goes out, and a
  `SYNCH` after it; a round in which nothing waits stays open until something comes. Answers never wait, and what is before
  them goes out with them.

  At most 1024 messages wait. Of what comes then data is dropped and counted, and the next `SYNCH` says how much; answers are not, but a client that asks and never reads is let go (`full?/1`).
  """
  alias Player.Wire

  @most 1_024
  @most_answers 256
  @most_rules 64

  defstruct mode: :push, waiting: [], count: 0, dropped: 0, round: nil, rules: []

  @typedoc "Interface, index, type and subtype by their codes; -1 in a rule means any."
  @type codes :: {integer(), integer(), integer(), integer()}
  @type t :: %__MODULE__{
          mode: :push | :pull,
          waiting: [{:answer | codes(), iodata()}],
          count: non_neg_integer(),
          dropped: non_neg_integer(),
          round: nil | {said? :: boolean()},
          rules: [{codes(), :accept | :replace | :ignore}]
        }

  @doc "The same in another mode; a round ends with it."
  @spec mode(t(), :push | :pull) :: t()
  def mode(queue, mode), do: %{queue | mode: mode, round: nil}

  @doc "A rule for data; the newest counts first, and one for the same messages takes the place of the older."
  @spec rule(t(), codes(), :accept | :replace | :ignore) :: t()
  def rule(queue, codes, rule),
    do: %{
      queue
      | rules: Enum.take([{codes, rule} | List.keydelete(queue.rules, codes, 0)], @most_rules)
    }

  @doc "An answer, behind what waits."
  @spec answer(t(), iodata()) :: t()
  def answer(queue, bytes), do: push(queue, {:answer, bytes})

  @doc "The answer to a request for a round, before all that waits; the round begins."
  @spec round(t(), iodata()) :: t()
  def round(queue, bytes) do
    waiting = queue.waiting ++ [{:answer, bytes}]
    round = if queue.mode == :pull, do: {false}
    %{queue | waiting: waiting, count: queue.count + 1, round: round}
  end

  @doc """
  Data, as the rules and the length of the queue allow.

      iex> alias Player.Queue
      iex> queue = Queue.mode(%Queue{}, :pull) |> Queue.rule({-1, -1, 1, -1}, :replace)
      iex> queue = queue |> Queue.data({4, 0, 1, 1}, "old") |> Queue.data({5, 0, 1, 1}, "s") |> Queue.data({4, 0, 1, 1}, "new")
      iex> {[], queue} = Queue.take(queue)
      iex> {bytes, queue} = queue |> Queue.round("ack") |> Queue.take()
      iex> {Enum.take(bytes, 3), queue.round}
      {["ack", "s", "new"], nil}
  """
  @spec data(t(), codes(), iodata()) :: t()
  def data(queue, codes, bytes) do
    case ruled(queue.rules, codes) do
      :ignore -> queue
      :accept -> accept(queue, codes, bytes)
      :replace -> queue |> without(codes) |> accept(codes, bytes)
    end
  end

  defp ruled(rules, codes) do
    Enum.find_value(rules, :accept, fn {pattern, rule} ->
      if like?(Tuple.to_list(pattern), Tuple.to_list(codes)), do: rule
    end)
  end

  defp like?(pattern, codes),
    do: pattern |> Enum.zip(codes) |> Enum.all?(fn {any, code} -> any in [-1, code] end)

  defp without(queue, codes) do
    case List.keydelete(queue.waiting, codes, 0) do
      same when length(same) == queue.count -> queue
      fewer -> %{queue | waiting: fewer, count: queue.count - 1}
    end
  end

  defp accept(%{count: count} = queue, _codes, _bytes) when count >= @most,
    do: %{queue | dropped: queue.dropped + 1}

  defp accept(queue, codes, bytes), do: push(queue, {codes, bytes})

  defp push(queue, message),
    do: %{queue | waiting: [message | queue.waiting], count: queue.count + 1}

  @doc "Whether more answers wait than a client that reads them asks for: libplayerc asks for one at a time."
  @spec full?(t()) :: boolean()
  def full?(%__MODULE__{count: count, waiting: waiting}),
    do:
      count > @most_answers and
        Enum.count(waiting, fn {what, _bytes} -> what == :answer end) > @most_answers

  @doc "What goes out now, oldest first, `[]` for nothing; of a SYNCH the first 8 bytes of its header are there."
  @spec take(t()) :: {iodata(), t()}
  def take(%{mode: :push} = queue), do: all(queue)

  def take(%{round: nil} = queue) do
    {later, now} = Enum.split_while(queue.waiting, fn {what, _bytes} -> what != :answer end)
    bytes = now |> Enum.reverse() |> Enum.map(&elem(&1, 1))
    {bytes, %{queue | waiting: later, count: length(later)}}
  end

  def take(%{round: {said?}} = queue) do
    said? = said? or Enum.any?(queue.waiting, fn {what, _bytes} -> what != :answer end)
    {bytes, queue} = all(queue)

    if said?,
      do: {bytes ++ [synch(queue.dropped)], %{queue | round: nil, dropped: 0}},
      else: {bytes, %{queue | round: {false}}}
  end

  defp all(queue) do
    bytes = queue.waiting |> Enum.reverse() |> Enum.map(&elem(&1, 1))
    {bytes, %{queue | waiting: [], count: 0}}
  end

  defp synch(0), do: [<<0::64>>, Wire.encode({:player, 0}, :synch, 1, %{}, 0.0)]

  defp synch(dropped),
    do: [<<0::64>>, Wire.encode({:player, 0}, :synch, 2, %{dropped: dropped}, 0.0)]
end
