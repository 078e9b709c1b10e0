defmodule Swarm.MemberSpec do
  @moduledoc """
  A robot from its file, as a member of a fleet: `Robot.File` says what it is, this adds its mission and
  its link. Pure.

      {:ok, file} = Robot.File.load("config/robots/mag1.exs")
      {:ok, config} = Swarm.MemberSpec.config(file)
      {:ok, _pid} = Robot.Fleet.start_robot(Robot.Fleet, config, :permanent)
  """
  alias Robot.Config
  alias Swarm.Comms
  alias Missions.Landmark

  @doc "What the robot is started with; an error is one line."
  @spec config(Robot.File.t()) :: {:ok, Config.t()} | {:error, line :: String.t()}
  def config(%Robot.File{} = file) do
    with {:ok, mission} <- mission(file.policies),
         {:ok, config} <- Robot.File.config(file) do
      {:ok, Comms.join(%{config | mission: mission})}
    end
  end

  @doc "The options of the node's mesh (`Swarm.Mesh.Options`) that the file gives."
  @spec mesh(Robot.File.t()) :: keyword()
  def mesh(%Robot.File{network: network}), do: network

  defp mission(policies) do
    {mission, options} = Keyword.pop(policies, :mission)

    case mission do
      nil ->
        {:ok, nil}

      :landmark ->
        with {:ok, _policy} <- Landmark.Policy.options(options), do: {:ok, {Landmark, options}}
    end
  end
end
