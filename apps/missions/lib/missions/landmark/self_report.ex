defmodule Missions.Landmark.SelfReport do
  @moduledoc false
  # Tells what a robot claims of its landmark mission: to all others (`Missions.Landmark.Claim`), and to people. Pure.
  alias Missions.Landmark
  alias Missions.Landmark.{Blocker, LandmarkTrack, Lookout, Marks}
  alias Missions.Landmark.Follower.Guide
  alias Missions.Landmark.Leader.Loss

  @doc "The claim of this tick."
  @spec claim(Landmark.State.t()) :: map()
  def claim(mission) do
    leading? = mission.phase == :lead

    %{
      phase: mission.phase,
      epoch: mission.epoch,
      leader: mission.leader,
      sight:
        if(Landmark.State.sees?(mission),
          do: %{
            size_ppm: mission.sight.size_ppm,
            distance: mission.sight.distance && round(mission.sight.distance * 1000)
          }
        ),
      standing: standing?(mission),
      sd: Marks.told(mission),
      uncertainty: uncertainty(mission.percept),
      in_place: mission.phase == :follow and mission.follower.in_place?,
      unsure: mission.phase == :follow and mission.follower.unsure?,
      blind: LandmarkTrack.blind?(mission.pictured_ms, mission.now_ms),
      blocked: mission.phase == :follow and mission.follower.progress.blocked?,
      says: says(mission),
      blocked_by:
        if(mission.phase == :follow, do: Blocker.words(mission.follower.progress.blocker)),
      sees: Guide.sees(mission),
      formed: leading? and mission.leadership.formed?,
      anchor: if(leading?, do: mission.anchor)
    }
  end

  # A follower that is in its slot or under way by its own estimate, but not certain enough to say so.
  defp says(%{phase: :follow, follower: %{unsure?: true} = follower, percept: percept}) do
    within = with metres when metres != nil <- uncertainty(percept), do: within(metres)
    where = if follower.facing.unsure_ms, do: "in its slot, but", else: "on its way, but"
    "#{where} NOT SURE of its place#{within}"
  end

  defp says(%{phase: :lead} = mission), do: Loss.says(mission)
  defp says(%{phase: phase} = mission) when phase in [:wander, :rest], do: Lookout.says(mission)
  defp says(_mission), do: nil

  defp within(metres), do: " (±#{:erlang.float_to_binary(metres * 1.0, decimals: 2)} m)"

  defp uncertainty(%{uncertainty: %{radius: radius}}), do: radius
  defp uncertainty(_no_pose), do: nil

  defp standing?(%{phase: :lead, percept: percept}), do: Landmark.State.slow?(percept, 0.05)
  defp standing?(%{phase: :follow} = mission), do: mission.follower.holding?
  defp standing?(%{phase: :hold, percept: percept}), do: Landmark.State.slow?(percept, 0.05)
  defp standing?(%{phase: phase}), do: phase in [:idle, :search, :agree, :rest, :wait, :halt]
end
