defmodule Agents.MailboxTest do
  use ExUnit.Case, async: true
  doctest Agents.Mailbox
  alias Agents.{Envelope, Inbox, Mailbox}

  defp envelope(class, n),
    do: Envelope.new(:inform, :mag1, n, class: class, conversation: {:mag1, 1})

  defp fill(mailbox, list),
    do: Enum.reduce(list, mailbox, fn {c, n}, m -> Mailbox.put(m, envelope(c, n)) end)

  defp empty(mailbox) do
    case Mailbox.take(mailbox) do
      {nil, mailbox} -> {[], mailbox}
      {envelope, mailbox} -> with {rest, m} <- empty(mailbox), do: {[envelope.content | rest], m}
    end
  end

  test "telemetry is dropped first, urgent envelopes are taken first" do
    for {limit, list, out, dropped} <- [
          {3, [data: 1, telemetry: 2, data: 3], [1, 2, 3], {0, 0, 0}},
          {3, [data: 1, telemetry: 2, urgent: 3], [3, 1, 2], {0, 0, 0}},
          {2, [data: 1, telemetry: 2, telemetry: 3], [1, 3], {1, 0, 0}},
          {2, [data: 1, telemetry: 2, data: 3], [1, 3], {1, 0, 0}},
          {2, [data: 1, data: 2, data: 3], [2, 3], {0, 1, 0}},
          {2, [data: 1, data: 2, telemetry: 3], [1, 2], {1, 0, 0}},
          {2, [data: 1, data: 2, urgent: 3], [3, 1, 2], {0, 0, 0}},
          {2, [urgent: 1, urgent: 2, data: 3, data: 4, data: 5], [1, 2, 4, 5], {0, 1, 0}},
          {2, [urgent: 1, urgent: 2, urgent: 3], [1, 2], {0, 0, 1}}
        ] do
      {content, left} = limit |> Mailbox.new() |> fill(list) |> empty()
      assert content == out
      assert {left.dropped.telemetry, left.dropped.data, left.dropped.urgent} == dropped
      assert Mailbox.size(left) == 0
    end
  end

  # Compared with the obvious implementation: a list that is searched.
  test "it behaves as a list would" do
    for _ <- 1..300 do
      limit = :rand.uniform(6)

      {mailbox, list} =
        Enum.reduce(1..60, {Mailbox.new(limit), []}, fn n, {mailbox, list} ->
          if :rand.uniform(3) == 1 do
            {envelope, mailbox} = Mailbox.take(mailbox)
            {taken, list} = slow_take(list)
            assert taken == (envelope && {envelope.class, envelope.content})
            {mailbox, list}
          else
            class = Enum.random([:telemetry, :data, :data, :urgent])
            {Mailbox.put(mailbox, envelope(class, n)), slow_put(list, {class, n}, limit)}
          end
        end)

      assert Mailbox.size(mailbox) == length(list)
      assert Mailbox.size(mailbox) <= 2 * limit
    end
  end

  defp slow_take(list) do
    case Enum.find(list, &match?({:urgent, _}, &1)) || List.first(list) do
      nil -> {nil, []}
      one -> {one, List.delete(list, one)}
    end
  end

  defp slow_put(list, {class, _} = one, limit) do
    {urgent, others} = Enum.split_with(list, &match?({:urgent, _}, &1))
    oldest = Enum.find(others, &match?({:telemetry, _}, &1))

    cond do
      class == :urgent and length(urgent) == limit -> list
      class == :urgent or length(others) < limit -> list ++ [one]
      oldest -> List.delete(list, oldest) ++ [one]
      class == :telemetry -> list
      true -> List.delete(list, hd(others)) ++ [one]
    end
  end

  describe "the inbox of a process" do
    # Passes what this process was sent through the inbox until nothing more comes.
    defp handled(inbox, handled \\ []) do
      receive do
        message ->
          case Inbox.arrived(inbox, message) do
            {:handle, envelope, inbox} -> handled(inbox, [envelope.content | handled])
            {:wait, inbox} -> handled(inbox, handled)
          end
      after
        0 -> {Enum.reverse(handled), inbox}
      end
    end

    test "hands over one at a time, the urgent ones first, the limit kept" do
      for n <- 1..10, do: send(self(), envelope(:data, n))
      send(self(), envelope(:urgent, :stop))
      {handled, inbox} = handled(Inbox.new(limit: 4))
      assert handled == [:stop, 7, 8, 9, 10]

      assert %{data: 6, telemetry: 0, urgent: 0, rejected: 0, unwanted: 0, waiting: 0} =
               Inbox.counts(inbox)

      send(self(), envelope(:data, 11))
      assert {[11], _inbox} = handled(inbox)
    end

    test "drops what is malformed and what is not wanted, and takes no turn from strangers" do
      junk = [:junk, {Inbox, make_ref()}, %{envelope(:data, 1) | epoch: :x}, {:ok, 1}]
      for term <- junk, do: send(self(), term)
      send(self(), envelope(:data, :no))
      send(self(), envelope(:data, :yes))
      {handled, inbox} = handled(Inbox.new(template: [content: :yes]))
      assert handled == [:yes]
      assert %{rejected: 4, unwanted: 1} = Inbox.counts(inbox)
    end

    test "bad options raise at the start" do
      assert_raise ArgumentError, ~r/:speed/, fn -> Inbox.new(template: [speed: 1]) end
      assert_raise ArgumentError, fn -> Inbox.new(size: 1) end

      assert_raise ArgumentError, "limit: expected a whole number above 0, got 0", fn ->
        Inbox.new(limit: 0)
      end
    end
  end
end
