defmodule Lab.Fleet.Mission do
  @moduledoc false
  # Reads the option `mission:` of a fleet: `true` starts the mission of its setup, `false` does not start it; a name
  # (`Swarm.MissionRegistry`), with options or without, or `{module, options}` starts another `Robot.Mission`. Pure, except that
  # it loads the module.
  alias Lab.Trial.Setup
  alias Swarm.MissionRegistry

  @doc """
  The setup with that mission, and whether the mission should start; the error is one line.

      iex> Lab.Fleet.Mission.choose(%{mission: nil}, {NoSuchModule, []}, false)
      {:error, "mission: expected a Robot.Mission (init/2 and handle/2), got {NoSuchModule, []}"}
      iex> {:error, line} = Lab.Fleet.Mission.choose(%{mission: nil, robots: [:mag1]}, :landmrk, false)
      iex> line =~ ~r/^mission :landmrk is not known; .*landmark.*; did you mean :landmark\\?$/
      true
  """
  @spec choose(Setup.t(), term(), nodes? :: boolean()) ::
          {:ok, Setup.t(), begin? :: boolean()} | {:error, line :: String.t()}
  def choose(setup, begin?, _nodes?) when is_boolean(begin?), do: {:ok, setup, begin?}

  def choose(setup, name, nodes?) when is_atom(name) or is_binary(name),
    do: choose(setup, {name, []}, nodes?)

  def choose(setup, {module, options} = mission, nodes?)
      when is_atom(module) or is_binary(module) do
    cond do
      # A name is no module, and a wrong one has a better explanation.
      is_binary(module) or not String.starts_with?(Atom.to_string(module), "Elixir.") ->
        with {:ok, chosen} <- MissionRegistry.choose(mission, length(setup.robots)),
             do: choose(setup, chosen, nodes?)

      not Keyword.keyword?(options) ->
        {:error, "mission: expected options [key: value], got #{brief(mission)}"}

      not mission?(module) ->
        {:error, "mission: expected a Robot.Mission (init/2 and handle/2), got #{brief(mission)}"}

      nodes? and Application.get_application(module) not in MissionRegistry.parts([:lab]) ->
        {:error,
         "mission: expected a module of #{Enum.join(MissionRegistry.parts([:lab]), ", ")}, as processes of their " <>
           "own have only these, got #{brief(mission)}"}

      true ->
        {:ok, %{setup | mission: mission}, true}
    end
  end

  def choose(_setup, other, _nodes?),
    do:
      {:error, "mission: expected true, false, a name or {module, options}, got #{brief(other)}"}

  defp mission?(module) do
    Code.ensure_loaded?(module) and function_exported?(module, :init, 2) and
      function_exported?(module, :handle, 2)
  end

  defp brief(term), do: inspect(term, limit: 5, printable_limit: 40)
end
