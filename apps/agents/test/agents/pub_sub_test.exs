defmodule Agents.PubSubTest do
  use ExUnit.Case, async: true
  alias Agents.PubSub

  # The same tests for each adapter; one that is not installed is skipped, and says why.
  for carrier <- [Agents.PubSub.Local, Agents.PubSub.Phoenix] do
    describe inspect(carrier) do
      if carrier == Agents.PubSub.Phoenix do
        @describetag adapter: :phoenix_pubsub
        unless Code.ensure_loaded?(carrier),
          do: @describetag(skip: "phoenix_pubsub is not installed")
      end

      setup context do
        name = Module.concat(__MODULE__, "Bus#{context.line}")
        start_supervised!({unquote(carrier), name: name})
        %{bus: {unquote(carrier), name}}
      end

      test "subscribers get messages unchanged", %{bus: bus} do
        assert PubSub.broadcast(bus, "poses", :nobody) == :ok
        assert PubSub.subscribe(bus, "poses") == :ok
        assert PubSub.broadcast(bus, "poses", {:pose, 1}) == :ok
        assert PubSub.broadcast(bus, "other", :no) == :ok
        assert_received {:pose, 1}
        refute_received _

        task = Task.async(fn -> PubSub.broadcast(bus, "poses", :from_another) end)
        assert Task.await(task) == :ok
        assert_received :from_another
      end

      test "two subscriptions get a message twice, none gets nothing", %{bus: bus} do
        for _ <- 1..2, do: assert(PubSub.subscribe(bus, "twice") == :ok)
        PubSub.broadcast(bus, "twice", :a)
        assert_received :a
        assert_received :a
        refute_received :a
        assert PubSub.unsubscribe(bus, "twice") == :ok
        assert PubSub.unsubscribe(bus, "never") == :ok
        PubSub.broadcast(bus, "twice", :b)
        refute_received :b
      end

      test "many hear one message, and dead subscribers are forgotten", %{bus: bus} do
        parent = self()

        pids =
          for n <- 1..20 do
            spawn_link(fn ->
              :ok = PubSub.subscribe(bus, "many")
              send(parent, {:ready, n})
              receive do: (message -> send(parent, {n, message}))
            end)
          end

        for n <- 1..20, do: assert_receive({:ready, ^n})
        PubSub.broadcast(bus, "many", :hello)
        for n <- 1..20, do: assert_receive({^n, :hello})
        for pid <- pids, ref = Process.monitor(pid), do: assert_receive({:DOWN, ^ref, _, _, _})
        assert PubSub.broadcast(bus, "many", :hello) == :ok
      end

      test "without a bus there is an error" do
        bus = {unquote(carrier), __MODULE__.None}
        assert PubSub.subscribe(bus, "x") == {:error, :down}
        assert PubSub.unsubscribe(bus, "x") == {:error, :down}
        assert PubSub.broadcast(bus, "x", 1) == {:error, :down}
      end
    end
  end
end
