defmodule Soak.Orders do
  @moduledoc "Gives what people would order while a run of `bin/soak` goes on, given on nodes that may be about to end."
  alias Lab.Node.Log
  alias Soak.State

  @order_ms 8_000
  @again_ms 2_000

  @doc "Orders what people would order now: a reset until nobody is held, a start where no mission runs."
  @spec due(State.t()) :: State.t()
  def due(%{start_until_us: until, start_next_us: next} = s) do
    now = Log.now()

    cond do
      now < next ->
        s

      s.reset? and Enum.any?(s.judge.stops.held, &match?({_robot, true}, &1)) ->
        order(again(s, now), {:reset, []})

      now > until or s.judge.stops.order != nil ->
        s

      true ->
        start_idle(again(s, now))
    end
  end

  defp again(s, now), do: %{s | start_next_us: now + @again_ms * 1000}

  defp start_idle(s) do
    case for robot <- s.fleet.robots, idle?(s.judge.claims[robot]), s.vms[robot], do: robot do
      [] -> s
      idle -> order(s, {:start, [[robots: idle, formation: s.formation]]})
    end
  end

  defp idle?(%{phase: phase}), do: phase == :idle
  defp idle?(_none), do: true

  @doc "Gives an order on the first node that is there; nobody waits for the answer."
  @spec order(State.t(), {atom(), list()}) :: State.t()
  def order(s, order) do
    case Enum.find(s.fleet.robots, &State.here?(s, &1)) do
      nil -> s
      from -> call(s, from, order)
    end
  end

  @doc "Gives an order on this node. With a `tag` the run gets the answer, if there is one, and the robots that the node knew before, as `{:later, {tag, answer, robots}}`."
  @spec call(State.t(), atom(), {atom(), list()}, tag :: term()) :: State.t()
  def call(s, from, {function, arguments}, tag \\ nil) do
    vm = s.vms[from]
    runner = self()

    aside(
      fn ->
        known = if tag, do: Vm.call(vm, Swarm.Transport, :robots, [], @order_ms)
        answer = Vm.call(vm, Swarm, function, arguments, @order_ms)
        if tag, do: send(runner, {:later, {tag, answer, known}})
        answer
      end,
      &"#{from}: #{function} #{words(&1)}"
    )

    s
  end

  defp words(:ok), do: "ok"
  defp words({:error, line}), do: line

  @doc "Asks a node something, beside the run, because it may be killed or freeze meanwhile; the journal gets the words."
  @spec aside(fun(), (term() -> String.t())) :: :ok
  def aside(ask, say) do
    runner = self()

    spawn(fn ->
      words =
        try do
          say.(ask.())
        catch
          :exit, _reason -> "no answer"
        end

      send(runner, {:said, words})
    end)

    :ok
  end
end
