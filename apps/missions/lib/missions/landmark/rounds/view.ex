defmodule Missions.Landmark.Rounds.View do
  @moduledoc "Decides which robots take part in the landmark mission, as far as a robot hears. Pure."
  alias Missions.Landmark
  alias Swarm.Membership.Heartbeat

  @doc "All that take part in the mission and are not gone, this robot too, sorted."
  @spec view(Landmark.State.t()) :: [atom()]
  def view(mission), do: Landmark.State.company(mission).view

  @doc "The highest epoch of the leaders that are heard; -1 without one."
  @spec leading_epoch(Landmark.State.t()) :: integer()
  def leading_epoch(mission), do: Landmark.State.company(mission).leading_epoch

  @doc "The heartbeats of the others that are not gone."
  @spec beats(Landmark.State.t()) :: %{atom() => Heartbeat.t()}
  def beats(mission), do: Landmark.State.beats(mission)
end
