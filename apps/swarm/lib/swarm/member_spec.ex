defmodule Swarm.MemberSpec do
  @moduledoc """
  Makes a robot from its file a member of a fleet: `Robot.File` describes the robot, this adds its
  mission and its comms. Pure.

      {:ok, file} = Robot.File.load("config/robots/mag1.exs")
      {:ok, config} = Swarm.MemberSpec.config(file)
      {:ok, _pid} = Robot.Fleet.start_robot(Robot.Fleet, config, :permanent)
  """
  alias Robot.Config
  alias Swarm.{Comms, Missions}

  @doc "What the robot is started with; an error is one line."
  @spec config(Robot.File.t()) :: {:ok, Config.t()} | {:error, line :: String.t()}
  def config(%Robot.File{} = file) do
    with {:ok, mission} <- mission(file.policies),
         {:ok, config} <- Robot.File.config(file) do
      {:ok, Comms.join(%{config | mission: mission})}
    end
  end

  @doc "The options of the node's mesh (`Mesh.Options`) that the file gives."
  @spec mesh(Robot.File.t()) :: keyword()
  def mesh(%Robot.File{network: network}), do: network

  defp mission(policies) do
    case Keyword.pop(policies, :mission) do
      {nil, _options} ->
        {:ok, nil}

      {name, options} ->
        with {:ok, module} <- Missions.fetch(name),
             {:ok, options} <- Missions.options(module, options, nil),
             do: {:ok, {module, options}}
    end
  end
end
