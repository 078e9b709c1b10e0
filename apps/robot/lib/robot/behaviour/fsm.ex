defmodule Robot.Behaviour.Fsm do
  @moduledoc """
  Runs a finite state machine of behaviours, whose outcomes select the transitions.

      Fsm.new(
        start: :search,
        states: %{search: {FindBlob, colour: "Yellow"}, go: {TrackBlob, []}, rest: {Rest, []}},
        next: %{{:search, 1} => :go, {:search, 0} => :rest}
      )

  Entering a state starts its behaviour afresh. `{state, :any}` in `next` matches outcomes that
  have no entry of their own. An outcome without an entry ends the machine with that outcome.
  """
  @behaviour Robot.Behaviour
  alias Hal.Options

  # The most transitions in one tick. A machine that wants more, such as one that cycles,
  # continues at the next tick.
  @most 8

  @impl Robot.Behaviour
  def new(options) do
    table = [
      start: [{:check, &is_atom/1, "one of the states"}, required: true],
      states: [{:check, &is_map/1, "a map of states"}, required: true],
      next: [{:check, &is_map/1, "a map of transitions"}, default: %{}]
    ]

    options = Options.check!(options, table, "fsm")
    %{start: start, states: states, next: next} = Map.new(options)

    for state <- [start | Enum.flat_map(next, fn {{from, _outcome}, to} -> [from, to] end)],
        not is_map_key(states, state) do
      raise ArgumentError,
            "fsm option next or start names #{inspect(state)}, which is not a state"
    end

    {__MODULE__, %{states: states, next: next, at: start, running: enter(states, start)}}
  end

  defp enter(states, name) do
    {module, options} = Map.fetch!(states, name)
    module.new(options)
  end

  @doc "The name of the present state."
  @spec at(Robot.Behaviour.t()) :: term()
  def at({__MODULE__, %{at: at}}), do: at

  @impl Robot.Behaviour
  def tick(percept, state), do: tick(percept, state, @most)

  defp tick(percept, state, left) do
    case Robot.Behaviour.tick(state.running, percept) do
      {:running, wish, running} -> {:running, wish, {__MODULE__, %{state | running: running}}}
      {:done, outcome, wish} -> follow(percept, state, outcome, wish, left)
    end
  end

  defp follow(percept, state, outcome, wish, left) do
    case Map.get(state.next, {state.at, outcome}) || Map.get(state.next, {state.at, :any}) do
      nil ->
        {:done, outcome, wish}

      to ->
        state = %{state | at: to, running: enter(state.states, to)}

        if left > 0,
          do: tick(percept, state, left - 1),
          else: {:running, wish, {__MODULE__, state}}
    end
  end
end
