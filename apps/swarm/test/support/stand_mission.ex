defmodule Swarm.StandMission do
  @moduledoc """
  A mission that only stands once it is started, for tests of the fleet that need any mission.
  """
  @behaviour Robot.Mission

  @impl Robot.Mission
  def init(_robot, _options), do: {:idle, :idle, []}

  @impl Robot.Mission
  def handle({:command, :start}, _mission), do: {:stand, :stand, []}
  def handle(_event, mission), do: {mission, mission, []}

  @impl Robot.Mission
  def options(options, _robots) do
    case Keyword.keys(options) -- [:formation] do
      [] -> {:ok, options}
      [key | _] -> {:error, "#{key} is not an option of standing"}
    end
  end
end
