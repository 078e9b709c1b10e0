defmodule Console.PageClientTest do
  @moduledoc "What a page is told while it looks at it, without a browser."
  use ExUnit.Case, async: true
  alias Console.Page.{Client, Feed}

  defmodule Slow do
    def nodes(test) do
      send(test, {:asked, self()})
      receive do: (answer -> answer)
    end
  end

  setup do
    test = self()
    {:ok, feed} = Feed.start_link(%{module: Slow, live: test})
    {:ok, client} = Client.start_link(feed, &send(test, {:told, &1}))
    %{client: client}
  end

  defp watch(client, on?) do
    :ok = Client.watch(client, :nodes, on?)
    _done = :sys.get_state(client)
  end

  defp answer(why) do
    assert_receive {:asked, asker}
    send(asker, {:error, why})
  end

  test "one question is under way, however often it asks", %{client: client} do
    for _time <- 1..100, on? <- [true, false], do: watch(client, on?)
    watch(client, true)
    assert_receive {:asked, asker}
    refute_received {:asked, _another}
    send(asker, {:error, "one"})
    assert_receive {:told, told}
    assert told =~ "one"
  end

  test "it asks again, tells what is new, and nothing that is looked at no longer", %{
    client: client
  } do
    watch(client, true)
    for why <- ["one", "one", "two"], do: answer(why)
    assert_receive {:told, one}
    assert_receive {:told, two}
    assert one =~ "one" and two =~ "two"
    assert_receive {:asked, asker}, 2_000
    watch(client, false)
    ref = Process.monitor(asker)
    send(asker, {:error, "three"})
    assert_receive {:DOWN, ^ref, :process, ^asker, :normal}
    _done = :sys.get_state(client)
    refute_received {:told, _three}

    # Looked at again, it is told anew.
    watch(client, true)
    answer("two")
    assert_receive {:told, ^two}
  end
end
