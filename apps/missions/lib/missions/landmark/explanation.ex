defmodule Missions.Landmark.Explanation do
  @moduledoc "Tells what the landmark mission knows and has decided, for people who ask why. Pure."
  alias Missions.Landmark.State
  alias Swarm.Agreement.Round

  @doc """
  The mission's state in lines, each with its label: its phase, its leader, the last round and
  what was reported in it, and what it found itself.
  """
  @spec lines(State.t()) :: [{label :: String.t(), text :: String.t()}]
  def lines(%State{} = mission) do
    [
      {"phase", "#{mission.phase} since #{seconds(mission.since_ms)} s"},
      {"group", group(mission)},
      {"search", search(mission)}
    ] ++ last_round(mission.round)
  end

  defp group(%{leader: nil}), do: "no leader"

  defp group(mission) do
    "#{mission.leader} leads epoch #{mission.epoch}" <>
      if(mission.size_ppm, do: ", elected with #{share(mission.size_ppm)}", else: "") <>
      case order(mission) do
        [] -> ""
        order -> ", places in order: #{names(order)}"
      end
  end

  defp order(%{leader: me, me: me, order: order}), do: order
  defp order(%{anchor: %{order: order}}), do: order
  defp order(_not_told), do: []

  defp search(%{scan: nil, tries: tries}), do: "no turn has ended; #{tries} found nothing before"
  defp search(%{scan: :found}), do: "the last turn found the landmark"

  defp search(%{scan: :nothing, tries: tries}),
    do: "the last turn found nothing, the #{tries}. time"

  defp last_round(%Round{id: {epoch, counter, opener}} = round) do
    [
      {"round",
       "#{epoch}.#{counter} by #{opener} for a #{round.purpose}: #{round.phase}, among #{names(round.view)}"}
      | for(robot <- round.view, do: {"  #{robot}", report(round.reports[robot], robot, round)})
    ]
  end

  defp last_round(_none), do: [{"round", "none"}]

  defp report(nil, robot, %{me: robot, report: :busy}), do: "still looks around"
  defp report(nil, _robot, _round), do: "has not reported"
  defp report(%{merit: nil} = report, _robot, _round), do: "found nothing#{led(report)}"

  defp report(report, _robot, _round),
    do: "found it, #{share(report.merit)}#{led(report)}"

  defp led(%{led: 0}), do: ""
  defp led(%{led: count}), do: "; it leads #{count}"

  defp share(ppm), do: "#{:erlang.float_to_binary(ppm / 10_000, decimals: 2)} % of its picture"
  defp seconds(ms), do: :erlang.float_to_binary(ms / 1_000, decimals: 1)
  defp names(robots), do: Enum.map_join(robots, ", ", &Atom.to_string/1)
end
