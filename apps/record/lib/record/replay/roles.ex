defmodule Record.Replay.Roles do
  @moduledoc false
  # Carries out the roles of a robot (`Robot.Role`) on what was recorded of them (`Robot.Trace`). Pure if the mission is.
  alias Robot.Role

  @type t :: Role.state()
  @type result :: {t(), effects :: [Role.effect()]}

  # The module of a role is that of its state.
  @names Robot.Trace.roles()

  # Of orders only those are recorded that the board did not refuse: here its wheels are armed.
  @board %{arming: {%{state: :armed, why: nil}, 0}}

  @doc """
  Whether a replay can do something with an entry of this role, kind and content: a state must have
  the form that it has in this version of the program.

      iex> alias Record.Replay.Roles
      iex> {Roles.entry?(:gate, :input, :tick), Roles.entry?(:head, :input, :tick)}
      {true, false}
      iex> {Roles.entry?(:gate, :lost, 2), Roles.entry?(:gate, :begin, {%{}, %{}})}
      {true, false}
  """
  @spec entry?(term(), term(), term()) :: boolean()
  def entry?(role, kind, what) when role in @names do
    case kind do
      kind when kind in [:input, :effect] -> true
      :lost -> is_integer(what) and what > 0
      kind when kind in [:begin, :checkpoint] -> state?(role, what)
      _unknown -> false
    end
  end

  def entry?(_role, _kind, _what), do: false

  defp state?(role, %module{} = state) do
    Code.ensure_loaded?(module) and function_exported?(module, :handle, 4) and
      function_exported?(module, :name, 0) and module.name() == role and
      Map.keys(state) == Map.keys(struct(module))
  end

  defp state?(_role, _other), do: false

  @doc "What a role does on an input at this time of the robot's clock; only the effects that are recorded."
  @spec input(t(), Role.input(), at_ms :: integer()) :: result()
  def input(%module{} = state, input, at_ms) do
    {state, effects} = module.handle(input, at_ms, state, @board)
    {state, for(effect <- effects, Role.recorded?(effect), do: Role.recorded(effect))}
  end
end
