defmodule Missions.Landmark.Rounds.View do
  @moduledoc "Who takes part in the landmark mission, as far as a robot hears. Pure."
  alias Missions.Landmark
  alias Swarm.Membership.Heartbeat

  @doc "All that take part in the mission and are not gone, this robot too, sorted."
  @spec view(Landmark.State.t()) :: [atom()]
  def view(mission) do
    others = for {id, beat} <- beats(mission), beat.phase != :idle, do: id

    Enum.sort([mission.me | others])
  end

  @doc "The highest epoch of the leaders that are heard; -1 without one."
  @spec leading_epoch(Landmark.State.t()) :: integer()
  def leading_epoch(mission) do
    for {_id, %{phase: :lead, epoch: epoch}} <- beats(mission), reduce: -1 do
      highest -> max(highest, epoch)
    end
  end

  @doc "The heartbeats of the others that take part."
  @spec beats(Landmark.State.t()) :: %{atom() => Heartbeat.t()}
  def beats(mission), do: Landmark.State.beats(mission)
end
