defmodule Missions.Landmark.Transitions.Entry do
  @moduledoc false
  # Decides what a robot forgets and takes up when it enters a phase of `Missions.Landmark.Transitions`.
  # Pure.
  alias Missions.Landmark
  alias Missions.Landmark.{Follower, Leader, Transitions}
  alias Swarm.Agreement.Round

  @doc "The mission at the beginning of a phase."
  @spec enter(Landmark.State.t(), Transitions.phase()) :: Landmark.State.t()
  def enter(mission, phase) do
    mission = %{
      mission
      | since_ms: mission.now_ms,
        role: role(phase) || mission.role,
        led: if(phase == :agree, do: mission.led, else: 0)
    }

    case phase do
      :idle ->
        %{
          mission
          | phase: :idle,
            scan: nil,
            tries: 0,
            lookout: nil,
            verdict: nil,
            leader: nil,
            anchor: nil,
            place: nil,
            round: Map.merge(Round.new(mission.me), Map.take(mission.round, [:highest, :guard]))
        }

      :search ->
        %{mission | phase: :search, scan: nil, verdict: nil, rescan?: false}

      :wander ->
        %{mission | phase: :wander, verdict: nil, scan: nil, tries: mission.tries + 1}

      :rest ->
        %{mission | phase: :rest, verdict: nil, scan: :nothing, tries: 0}

      :agree ->
        forget(%{mission | phase: :agree, leader: nil})

      phase when phase in [:wait, :halt, :hold] ->
        %{
          mission
          | phase: phase,
            leader: nil,
            anchor: nil,
            verdict: nil,
            scan: nil,
            round: Round.leave(mission.round)
        }

      :lead ->
        Leader.begin(%{
          mission
          | phase: :lead,
            verdict: nil,
            tries: 0,
            lookout: nil,
            leader: mission.me
        })

      :follow ->
        follow(%{mission | phase: :follow, tries: 0, lookout: nil})
    end
  end

  defp role(:lead), do: :leader
  defp role(:follow), do: :follower
  defp role(phase) when phase in [:idle, :search, :wander, :rest], do: :searcher
  defp role(_between), do: nil

  # A robot cannot join by the anchor that it published itself as a leader.
  defp forget(%{anchor: %{leader: me}, me: me} = mission), do: %{mission | anchor: nil}
  defp forget(mission), do: mission

  defp follow(%{verdict: {:leader, leader}} = mission),
    do: Follower.begin(%{mission | verdict: nil, leader: leader})

  defp follow(mission),
    do:
      Follower.begin(%{
        mission
        | leader: mission.anchor.leader,
          epoch: mission.anchor.epoch,
          verdict: nil
      })
end
