defmodule Swarm.MemberSpec do
  @moduledoc """
  Turns a robot from its file into a member of a fleet: `Robot.File` describes the robot; this
  module defines the values of the fleet's keys, and adds mission and comms.

      {:ok, file} = Swarm.MemberSpec.load("config/robots/mag1.exs")
      {:ok, config} = Swarm.MemberSpec.config(file)
      {:ok, _pid} = Robot.Fleet.start_robot(Robot.Fleet, config, :permanent)
  """
  alias Hal.Options.{Type, Wording}
  alias Robot.File.{RecordOptions, Terms}
  alias Swarm.{Comms, MissionRegistry}

  @doc """
  The robot of the file at `path`, or all its errors, one line each: `Robot.File.load/2`, with the
  missions, formations and networks that this build knows.
  """
  @spec load(Path.t()) :: {:ok, Robot.File.t()} | {:error, [line :: String.t(), ...]}
  def load(path), do: Robot.File.load(path, tables: tables())

  @doc """
  The types of those keys of a robot file that belong to the fleet, for `Robot.File`: `network:`
  (`Mesh.Options.file_table/0`), and `policies:`, a mission (`Swarm.MissionRegistry`) with its options.
  """
  @spec tables() :: [{:network | :policies, Type.t()}]
  def tables do
    mission = MissionRegistry.type()

    [
      network: {:keys, Mesh.Options.file_table()},
      policies:
        {:check, &policies(&1, mission), "[mission: name, …] with options of that mission"}
    ]
  end

  defp policies(given, mission) do
    with true <- Type.keys?(given),
         {named, options} =
           Enum.split_with(given, fn {key, _} -> to_string(key) == "mission" end),
         {:ok, named} <- Type.read({:keys, mission: mission}, named),
         do: policies(named, options, mission)
  end

  defp policies(named, [], _mission) when named in [[], [mission: nil]], do: {:ok, named}

  defp policies([mission: {_name, _own}] = named, [], _mission) do
    with {:ok, _mission} <- MissionRegistry.choose(named[:mission], nil), do: {:ok, named}
  end

  defp policies([mission: {name, _own}], [{key, _value} | _], _mission) do
    {:error, [{["#{key}"], "is not allowed beside {#{inspect(name)}, …}: write it in there"}]}
  end

  defp policies(named, options, mission) do
    with {:ok, module} <- module(named[:mission]),
         {:ok, values} <- options(MissionRegistry.option_table(module), named, options, mission),
         {:ok, _all} <- MissionRegistry.options(module, Keyword.delete(values, :mission), nil),
         do: {:ok, values}
  end

  # Options without a mission are those of the first mission.
  defp module(nil), do: MissionRegistry.default()
  defp module(name), do: MissionRegistry.fetch(name)

  defp options(nil, named, options, _mission) do
    case {Keyword.keyword?(options), Terms.strange(options)} do
      {true, nil} -> {:ok, named ++ options}
      {false, nil} -> false
      {_, name} -> Wording.refuse("a name that this build knows", name)
    end
  end

  defp options(table, named, options, mission),
    do: Type.read({:keys, [{:mission, mission} | table]}, named ++ options)

  @doc "The configuration that the robot is started with; an error is one line."
  @spec config(Robot.File.t()) :: {:ok, Robot.Config.t()} | {:error, line :: String.t()}
  def config(%Robot.File{} = file) do
    with :ok <- listed(file),
         {:ok, mission} <- mission(file.policies),
         {:ok, recorder} <- recorder(file),
         {:ok, config} <- Robot.File.config(file) do
      {:ok, config |> recorded(recorder) |> Map.put(:mission, mission) |> Comms.join()}
    end
  end

  # The others would not hear it.
  defp listed(%{id: id, network: network}) do
    if id in Keyword.get(network, :fleet, [id]),
      do: :ok,
      else:
        {:error, "network.fleet: expected all robots of the fleet, with #{id}, whose file it is"}
  end

  defp recorded(config, nil), do: config

  defp recorded(config, {recorder, {id, _options}}),
    do: %{config | trace: {recorder, :trace, [id]}}

  @doc """
  The robot's recorder, a part of the node, as a child of `Swarm.Supervisor`; `nil` if it is not recorded. The configuration
  names the module, which lives in an app above this one, and to which the robot's processes hand their trace
  (`t:Robot.Trace.entry/0`):

      config :swarm, recorder: Record.Recorder
  """
  @spec recorder(Robot.File.t()) ::
          {:ok, {module(), {robot :: atom(), keyword()}} | nil} | {:error, line :: String.t()}
  def recorder(%Robot.File{record: nil}), do: {:ok, nil}

  def recorder(%Robot.File{id: id, record: options}) do
    module = Application.get_env(:swarm, :recorder)

    cond do
      module == nil ->
        {:error, "record: no recorder is configured (config :swarm, recorder: …)"}

      not Code.ensure_loaded?(module) ->
        {:error, "record: #{inspect(module)} is configured, but not part of this release"}

      true ->
        with {:ok, all} <- RecordOptions.check(options), do: {:ok, {module, {id, all}}}
    end
  end

  @doc "The options of the node's mesh (`Mesh.Options`) that the file gives."
  @spec mesh(Robot.File.t()) :: keyword()
  def mesh(%Robot.File{network: network}), do: network

  defp mission(policies) do
    case Keyword.pop(policies, :mission) do
      {nil, _options} -> {:ok, nil}
      {{_name, _own} = mission, []} -> MissionRegistry.choose(mission, nil)
      {name, options} -> MissionRegistry.choose({name, options}, nil)
    end
  end
end
