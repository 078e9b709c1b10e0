defmodule Missions.Landmark.Rounds.Report do
  @moduledoc "Decides what a robot reports in a round of the landmark mission, and when. Pure."
  alias Missions.Landmark
  alias Missions.Landmark.{LandmarkTrack, Policy}
  alias Swarm.Agreement.Round

  # A sighting this old still counts in a report.
  @fresh_ms 1_000

  @doc "One tick: reports, once it can, in a round that waits for it."
  @spec update(Landmark.State.t()) :: Landmark.State.t()
  def update(%{round: %{phase: :collect, report: :busy} = round} = mission) do
    if Policy.bound?(mission, round.view), do: mission, else: report(mission, round.purpose)
  end

  def update(mission), do: mission

  defp report(mission, purpose) do
    case purpose do
      :change ->
        put_report(mission, LandmarkTrack.fresh?(mission.sight, mission.now_ms, @fresh_ms))

      :search when mission.scan == nil ->
        mission

      :search ->
        put_report(mission, mission.scan == :found or Landmark.State.sees?(mission))
    end
  end

  defp put_report(%{percept: %{pose: nil}} = mission, _found?), do: mission

  defp put_report(mission, found?) do
    found? = found? and mission.sight != nil

    report = %{
      merit: if(found?, do: mission.sight.size_ppm),
      pose: Landmark.State.millimetres(mission.percept.pose),
      led: if(mission.phase in [:lead, :agree], do: mission.led, else: 0),
      of: mission.of
    }

    %{mission | round: Round.report(mission.round, report)}
  end
end
