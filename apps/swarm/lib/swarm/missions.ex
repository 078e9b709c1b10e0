defmodule Swarm.Missions do
  @moduledoc """
  The missions for groups that this node knows, by name. They live in apps above this
  one, so the configuration lists them:

      config :swarm, missions: [landmark: Missions.Landmark]

  A robot whose file names no mission starts the first of them. `c:Robot.Mission.option_table/0`
  of a mission defines the options that a robot file may give it.
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

  @doc """
  The type of a mission's name, or `nil`, in a table of `Hal.Options`. It asks all missions for
  their options, so that the names of the options exist as atoms even for a reader that creates
  none.
  """
  @spec type() :: Hal.Options.Type.t()
  def type do
    known = known()
    Enum.each(known, fn {_name, module} -> option_table(module) || options(module, [], nil) end)

    if known == [],
      do: {:check, &(&1 == nil), "nil (#{allowed([])})"},
      else: {:one_of, [nil | Keyword.keys(known)]}
  end

  @doc """
  The options that a robot file may give a mission (`c:Robot.Mission.option_table/0`); `nil` if
  the mission does not define them.
  """
  @spec option_table(module()) :: Hal.Options.table() | nil
  def option_table(module) do
    if Code.ensure_loaded?(module) and function_exported?(module, :option_table, 0),
      do: module.option_table()
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
  Checks the options of a start by the mission (`c:Robot.Mission.options/2`). `robots` is how many
  start together, `nil` if that is not known. A mission without that callback takes no options.
  """
  @spec options(module(), keyword(), pos_integer() | nil) ::
          {:ok, keyword()} | {:error, line :: String.t()}
  def options(module, options, robots) do
    cond do
      not Code.ensure_loaded?(module) -> {:error, "#{inspect(module)} is not part of this build"}
      function_exported?(module, :options, 2) -> checked(module, module.options(options, robots))
      options == [] -> {:ok, []}
      true -> {:error, "#{inspect(module)} takes no options"}
    end
  end

  defp checked(_module, {:error, line} = error) when is_binary(line), do: error

  defp checked(module, answer) do
    with {:ok, options} <- answer, true <- Keyword.keyword?(options) do
      {:ok, options}
    else
      _other -> {:error, "#{inspect(module)}.options/2 returned neither options nor an error"}
    end
  end

  @doc "The applications that contain these missions, loaded."
  @spec apps() :: [atom()]
  def apps do
    for {_name, module} <- known(), {:ok, module} <- [loaded(module)], uniq: true do
      Application.get_application(module) || load_app(:code.which(module)) || :swarm
    end
  end

  # A node that was not started as a release loads no application that nobody starts.
  defp load_app(beam) when is_list(beam) do
    with [file] <- beam |> Path.dirname() |> Path.join("*.app") |> Path.wildcard(),
         {:ok, [{:application, app, _keys} = spec]} <- :file.consult(file),
         :ok <- :application.load(spec),
         do: app,
         else: (_none -> nil)
  end

  defp load_app(_defined_without_file), do: nil

  defp known, do: Application.get_env(:swarm, :missions, [])

  defp loaded(module) do
    if Code.ensure_loaded?(module),
      do: {:ok, module},
      else: {:error, "mission #{inspect(module)} is configured, but not part of this release"}
  end

  defp allowed([]), do: "no mission is configured (config :swarm, missions: …)"
  defp allowed(known), do: "#{Enum.map_join(known, ", ", &inspect(elem(&1, 0)))} is allowed"
end
