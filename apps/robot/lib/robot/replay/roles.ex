defmodule Robot.Replay.Roles do
  @moduledoc false
  # Describes what the processes of a robot do on an input (`Robot.Trace`), as functions of their
  # state: the same pure functions that they call, and the order in which they carry out the effects.
  # Pure if the mission is.
  alias Robot.Control.Executive
  alias Robot.Mission.Runner
  alias Robot.Navigation.Grid
  alias Robot.Safety.Gate
  alias Robot.Trace

  @typedoc "The state of a role, and what it needs to know besides (`Robot.Trace`)."
  @type t :: Gate.t() | Executive.t() | {struct(), map()}
  @type result :: {t(), effects :: [term()]}

  @states [
    gate: Gate,
    executive: Executive,
    pilot: {Runner, :state}
  ]

  @doc """
  Whether a replay can do something with an entry of this role, kind and content: a state must have
  the form that it has in this version of the program.

      iex> alias Robot.Replay.Roles
      iex> {Roles.entry?(:gate, :input, :tick), Roles.entry?(:head, :input, :tick)}
      {true, false}
      iex> {Roles.entry?(:gate, :lost, 2), Roles.entry?(:gate, :begin, {%{}, %{}})}
      {true, false}
  """
  @spec entry?(term(), term(), term()) :: boolean()
  def entry?(role, kind, what) when is_map_key(%{gate: 1, executive: 1, pilot: 1}, role) do
    case kind do
      kind when kind in [:input, :effect] -> true
      :lost -> is_integer(what) and what > 0
      kind when kind in [:begin, :checkpoint] -> state?(@states[role], what)
      _unknown -> false
    end
  end

  def entry?(_role, _kind, _what), do: false

  defp state?(module, %module{} = state), do: Map.keys(state) == Map.keys(struct(module))

  defp state?({module, fact}, {%module{} = state, facts}) when is_map_key(facts, fact),
    do: Map.keys(state) == Map.keys(struct(module))

  defp state?(_role, _other), do: false

  @doc "The state with which a role starts, and the effects that it has then."
  @spec begin(atom(), t()) :: result()
  def begin(:pilot, {%Runner{} = runner, %{state: nil}}) do
    state = Runner.state(runner)
    {{runner, %{state: state}}, [{:phase, state}]}
  end

  def begin(:pilot, {%Runner{}, %{state: _state}} = state), do: {state, []}
  def begin(:gate, %Gate{} = state), do: {state, []}
  def begin(:executive, %Executive{} = state), do: {state, []}

  @doc "What a role does on an input at this time of the robot's clock."
  @spec input(atom(), t(), term(), at_ms :: integer()) :: result()
  def input(:gate, state, input, at_ms), do: handled(Gate, state, input, at_ms)
  def input(:executive, state, input, at_ms), do: handled(Executive, state, input, at_ms)
  def input(:pilot, {runner, facts}, what, _at_ms), do: pilot(what, runner, facts)

  # Of orders only those are recorded that the board did not refuse: here its wheels are armed.
  @board %{arming: {%{state: :armed, why: nil}, 0}}

  defp handled(role, state, input, at_ms) do
    {state, effects} = role.handle(input, at_ms, state, @board)
    {state, Enum.filter(effects, &Trace.effect?/1)}
  end

  defp pilot({:start, module, options}, runner, facts),
    do: runner |> Runner.start(module, options) |> follow(facts)

  defp pilot(:stop, runner, facts),
    do: {{Runner.halt(runner), %{state: :idle}}, phase(facts.state, :idle)}

  defp pilot(:resume, runner, facts) do
    {:ok, runner} = Runner.resume(runner)
    {{runner, facts}, []}
  end

  defp pilot({:walls, packed}, runner, facts) do
    {:ok, walls} = Grid.Packed.unpack(packed)
    {{Runner.walls(runner, walls), facts}, []}
  end

  defp pilot(event, runner, facts), do: runner |> Runner.handle(event) |> follow(facts)

  defp follow({runner, effects}, facts) do
    state = Runner.state(runner)
    {{runner, %{state: state}}, effects ++ phase(facts.state, state)}
  end

  defp phase(state, state), do: []
  defp phase(_before, state), do: [{:phase, state}]
end
