defmodule Swarm.Comms.FloodTest do
  use ExUnit.Case, async: true
  alias Swarm.Comms.LoadShedder

  # The mailbox of a separate process after these messages.
  defp left(messages) do
    Task.async(fn ->
      for message <- messages, do: send(self(), message)
      dropped = LoadShedder.relieve([:tick, {:timer, 7}])
      {:messages, left} = Process.info(self(), :messages)
      {dropped, left}
    end)
    |> Task.await()
  end

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

  test "of too many orders the oldest are dropped, but no timer" do
    {59_503, left} = left([:tick, {:timer, 7}, {:timer, 8} | Enum.map(1..60_000, &order/1)])
    assert [:tick, {:timer, 7} | rest] = left
    assert List.first(rest) == order(59_503)
    assert List.last(rest) == order(60_000)
  end

  test "the time does not depend on how orders, calls and telemetry are mixed" do
    messages =
      for n <- 1..50_000, do: Enum.at([order(n), beat(n), {:"$gen_call", n, n}], rem(n, 3))

    {us, {dropped, _left}} = :timer.tc(fn -> left(messages) end)
    assert dropped == 49_500

    # Each message is looked at once: searching for telemetry behind all the orders again and
    # again took six seconds.
    assert us < 2_000_000
  end
end
