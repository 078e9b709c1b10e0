defmodule Swarm.BehaviourRegistry do
  @moduledoc """
  Lists the behaviours that a build has given names (`Robot.Behaviour`), for people who run one on a robot:

      config :swarm, behaviours: [corners: Mine.Square]

  A name reaches a behaviour everywhere: in `Swarm.run/3`, in the text command `run:corners:side=2`, and so at the prompt, on
  the page and in scenarios. A robot runs no behaviour without a name for others, and each robot needs the same build.
  """
  alias Hal.Options
  alias Hal.Options.{Suggest, Wording}

  @doc """
  The behaviour of this name, which may be text, or of this module; an error is one line with the names that there are.
  """
  @spec fetch(term()) :: {:ok, module()} | {:error, line :: String.t()}
  def fetch(name) do
    found = fn {key, module} -> name in [key, module] or Atom.to_string(key) == name end

    case Enum.find(known(), found) do
      {_name, module} -> loaded(module)
      nil -> unknown(name)
    end
  end

  @doc "The module of a behaviour that people have named, and its options, checked. The error is one line."
  @spec choose(term(), term()) :: {:ok, {module(), keyword()}} | {:error, line :: String.t()}
  def choose(name, options) do
    with {:ok, module} <- fetch(name),
         {:ok, options} <- checked(module, options),
         :ok <- Robot.Behaviour.check({module, options}),
         do: {:ok, {module, options}}
  end

  defp checked(module, options) do
    cond do
      not is_list(options) ->
        {:error,
         "#{name(module)}: expected options [key: value, …], got #{Wording.show(options)}"}

      function_exported?(module, :option_table, 0) ->
        Options.check(options, module.option_table(), name(module))

      true ->
        {:ok, options}
    end
  end

  @doc "The names of all behaviours, in their order."
  @spec names() :: [String.t()]
  def names, do: for({name, _module} <- known(), do: Atom.to_string(name))

  @doc "What people call a behaviour: its name, or its module if it has none."
  @spec name(module()) :: String.t()
  def name(module) do
    case List.keyfind(known(), module, 1) do
      {name, ^module} -> Atom.to_string(name)
      nil -> inspect(module)
    end
  end

  defp known, do: Application.get_env(:swarm, :behaviours, [])

  defp loaded(module) do
    if Code.ensure_loaded?(module),
      do: {:ok, module},
      else: {:error, "behaviour #{inspect(module)} is configured, but not part of this build"}
  end

  defp unknown(name) do
    shown = Wording.show(name)

    {:error,
     "behaviour #{shown} is not known; #{allowed(names())}#{Suggest.hint(shown, names())}"}
  end

  defp allowed([]), do: "none has a name (config :swarm, behaviours: …)"
  defp allowed(names), do: "expected #{Enum.join(names, " or ")}"
end
