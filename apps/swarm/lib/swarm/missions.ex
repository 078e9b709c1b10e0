defmodule Swarm.Missions do
  @moduledoc """
  The missions for groups that this node knows, by the names that robot files use. They live in apps above this
  one, so the configuration lists them:

      config :swarm, missions: [landmark: Missions.Landmark]

  A robot whose file names no mission starts the first of them.
  """

  @doc "The mission of this name; an error is one line."
  @spec fetch(atom()) :: {:ok, module()} | {:error, line :: String.t()}
  def fetch(name) do
    known = known()

    case Keyword.fetch(known, name) do
      {:ok, module} -> loaded(module)
      :error -> {:error, "mission #{inspect(name)} is not known; #{allowed(known)}"}
    end
  end

  @doc "The mission of a robot whose file names none."
  @spec default() :: {:ok, module()} | {:error, line :: String.t()}
  def default do
    case known() do
      [{_name, module} | _] -> loaded(module)
      [] -> {:error, allowed([])}
    end
  end

  @doc """
  The options of a start as the mission understands them (`c:Robot.Mission.options/2`). `robots` is how many
  start together, `nil` where that is not known. A mission without that callback takes no options.
  """
  @spec options(module(), keyword(), pos_integer() | nil) ::
          {:ok, keyword()} | {:error, line :: String.t()}
  def options(module, options, robots) do
    cond do
      function_exported?(module, :options, 2) -> module.options(options, robots)
      options == [] -> {:ok, []}
      true -> {:error, "#{inspect(module)} takes no options"}
    end
  end

  @doc "The applications that hold these missions."
  @spec apps() :: [atom()]
  def apps do
    for {_name, module} <- known(), {:ok, module} <- [loaded(module)], uniq: true do
      Application.get_application(module) || :swarm
    end
  end

  defp known, do: Application.get_env(:swarm, :missions, [])

  defp loaded(module) do
    if Code.ensure_loaded?(module),
      do: {:ok, module},
      else: {:error, "mission #{inspect(module)} is configured, and not part of this release"}
  end

  defp allowed([]), do: "no mission is configured (config :swarm, missions: …)"
  defp allowed(known), do: "#{Enum.map_join(known, ", ", &inspect(elem(&1, 0)))} is allowed"
end
