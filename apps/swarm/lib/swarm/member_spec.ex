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
         {:ok, recorders} <- recorders(file),
         {:ok, config} <- Robot.File.config(file) do
      {:ok, config |> recorded(recorders) |> Map.put(:mission, mission) |> Comms.join()}
    end
  end

  # The others would not hear it.
  defp listed(%{id: id, network: network}) do
    if id in Keyword.get(network, :fleet, [id]),
      do: :ok,
      else:
        {:error, "network.fleet: expected all robots of the fleet, with #{id}, whose file it is"}
  end

  defp recorded(config, []), do: config

  defp recorded(%{id: id} = config, _recorders),
    do: %{config | trace: {Application.get_env(:swarm, :recorder), :trace, [id]}}

  @doc """
  What records the robot (`record:`) and keeps its last minute (`incidents:`), parts of the node, as children of
  `Swarm.Supervisor`. The configuration names the modules, which live in an app above this one; the robot's processes hand their trace
  (`t:Robot.Trace.entry/0`) to the first:

      config :swarm, recorder: Record.Recorder, incidents: Record.Incidents
  """
  @spec recorders(Robot.File.t()) ::
          {:ok, [{module(), {robot :: atom(), keyword()}}]} | {:error, line :: String.t()}
  def recorders(%Robot.File{id: id} = file) do
    with {:ok, record} <- part(:record, file.record, :recorder, &RecordOptions.check/1),
         {:ok, kept} <-
           part(:incidents, file.incidents, :incidents, &RecordOptions.check_incidents/1),
         do: {:ok, for({module, options} <- record ++ kept, do: {module, {id, options}})}
  end

  defp part(_key, nil, _setting, _check), do: {:ok, []}

  defp part(key, options, setting, check) do
    case {Application.get_env(:swarm, :recorder), Application.get_env(:swarm, setting)} do
      {recorder, module} when recorder == nil or module == nil ->
        {:error, "#{key}: no recorder is configured (config :swarm, #{setting}: …)"}

      {_recorder, module} ->
        if Code.ensure_loaded?(module),
          do: with({:ok, all} <- check.(options), do: {:ok, [{module, all}]}),
          else: {:error, "#{key}: #{inspect(module)} is configured, but not part of this release"}
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
