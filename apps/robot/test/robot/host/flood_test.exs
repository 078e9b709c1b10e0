defmodule Robot.Host.FloodTest do
  use ExUnit.Case, async: true
  alias Robot.Host.LoadShedder

  # The mailbox of a separate process after these messages.
  defp left(messages) do
    Task.async(fn ->
      for message <- messages, do: send(self(), message)
      dropped = LoadShedder.relieve(&expendable?/1)
      {:messages, left} = Process.info(self(), :messages)
      {dropped, left}
    end)
    |> Task.await()
  end

  defp expendable?(cast), do: not match?({:command, _request, _ref}, cast)

  defp order(n), do: {:"$gen_cast", {:command, :ping, n}}
  defp beat(n), do: {:"$gen_cast", {:hear, n}}

  test "a few messages are left alone" do
    messages = Enum.map(1..2_000, &beat/1)
    assert left(messages) == {0, messages}
  end

  test "the oldest telemetry and junk are dropped, orders and timers stay in their order" do
    messages = for n <- 1..3_000, do: if(rem(n, 10) == 0, do: order(n), else: beat(n))
    {dropped, left} = left([:tick, {:DOWN, 1} | messages])
    assert dropped == 2_502
    assert [:tick, {:DOWN, 1} | rest] = left
    assert for({_, {:command, _, n}} <- rest, do: n) == for(n <- 1..300, do: 10 * n)
    assert List.last(rest) == order(3_000)
  end

  test "of too many orders the oldest are dropped, but no tick" do
    {dropped, left} = left([:tick, {:timer, 8} | Enum.map(1..60_000, &order/1)])
    assert [:tick | rest] = left
    assert dropped == 60_002 - length(left)
    assert List.first(rest) == order(60_001 - length(rest))
    assert List.last(rest) == order(60_000)
  end

  test "the work does not depend on how orders, calls and telemetry are mixed" do
    [few, many] =
      for count <- [5_000, 50_000] do
        send_all(
          for n <- 1..count, do: Enum.at([order(n), beat(n), {:"$gen_call", n, n}], rem(n, 3))
        )

        {:reductions, before} = Process.info(self(), :reductions)
        dropped = LoadShedder.relieve(&expendable?/1)
        {:reductions, later} = Process.info(self(), :reductions)
        assert {:message_queue_len, left} = Process.info(self(), :message_queue_len)
        assert dropped + left == count and dropped > left
        drain()
        later - before
      end

    # Each message is looked at once: to search for telemetry behind all the orders again and again is a hundred times
    # as much work for ten times as many.
    assert many < 20 * few
  end

  defp send_all(messages), do: Enum.each(messages, &send(self(), &1))
  defp drain, do: receive(do: (_message -> drain()), after: (0 -> :ok))
end
