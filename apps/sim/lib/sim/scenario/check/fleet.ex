defmodule Sim.Scenario.Check.Fleet do
  @moduledoc false
  # Judges expectations about the fleet: who leads, what robots claim, in which phase they are. Pure;
  # answers are those of `Sim.Scenario.Check`.
  alias Sim.Scenario.{Check, Expectation, View}
  alias Sim.Trial
  alias Sim.Trial.RunLog

  @doc "The answer at this tick; `memory` is what the last one returned, at first `nil`."
  @spec judge(Expectation.t(), Trial.t(), memory :: term()) :: Check.answer()
  def judge({:formed, _by}, trial, _),
    do: reach(RunLog.formed?(trial.run_log), fn so? -> formation(so?, trial) end)

  def judge({:not_formed}, trial, _), do: unformed(trial)
  def judge({:not_formed, _window}, trial, _), do: unformed(trial)

  # Whether the formation was left in this window. One that was never left is enough at its end.
  def judge({:formed_again, within}, trial, left?) do
    now? = RunLog.formed?(trial.run_log)
    left? = left? == true or not now?
    last? = View.at_s(trial) >= within[:after_s] + within[:within_s]
    {:reach, now? and (left? or last?), formation(now?, trial), left?}
  end

  def judge({:leader, _by}, trial, _),
    do: reach(View.leader(trial) != nil, fn _ -> leader(trial) end)

  def judge({:leader_changed, _within}, trial, first) do
    first = first || {:at_first, View.leader(trial)}
    {:at_first, before} = first
    now = View.leader(trial)

    {:reach, now not in [nil, before], "#{leader(trial)}, at first #{before || "nobody"} did",
     first}
  end

  def judge({:same_leader, _window}, trial, first) do
    first = first || {:at_first, View.leader(trial)}
    {:at_first, before} = first
    so? = before != nil and View.leader(trial) == before
    {:keep, so?, "#{leader(trial)}, at first #{before || "nobody"} did", first}
  end

  def judge({:one_leader, _window}, trial, _) do
    wrong = for {_part, leaders} = row <- View.leaders(trial), length(leaders) != 1, do: row
    keep(wrong == [], fn -> Enum.map_join(wrong, "; ", &leads/1) end, "one in each part")
  end

  def judge({:at_most_one_leader, grace}, trial, _) do
    worst_s = trial.run_log.agreement.rivals_worst_ms / 1000
    {:keep, worst_s <= grace[:grace_s], "two leaders in one part for #{worst_s} s at most", nil}
  end

  def judge({:agreed, _by}, trial, _) do
    named = for {id, claim} <- Trial.claims(trial), do: {id, claim[:leader], claim[:epoch]}
    views = Enum.uniq(for {_id, leader, epoch} <- named, do: {leader, epoch})
    so? = match?([{leader, _epoch}] when leader != nil, views)
    reach(so?, fn _ -> Enum.map_join(named, ", ", &view/1) end)
  end

  def judge({:rest, _by}, trial, _), do: all(trial, :all, &(View.role(trial, &1) == :rests))

  def judge({:phase, who, phase, _by}, trial, _),
    do: all(trial, who, &(View.phase(trial, &1) == phase))

  def judge({:never_phase, who, phase}, trial, _), do: never(who, phase, trial)
  def judge({:never_phase, who, phase, _window}, trial, _), do: never(who, phase, trial)

  def judge({:says, who, word, _by}, trial, _) do
    robots = View.who(trial, who) -- if who == :all, do: [View.leader(trial)], else: []

    said =
      for {id, claim} <- Trial.claims(trial),
          id in robots,
          do: {id, RunLog.account(trial.run_log, claim).says}

    so? = said != [] and Enum.all?(said, fn {_id, words} -> word in words end)
    reach(so?, fn _ -> Enum.map_join(said, ", ", &says/1) end)
  end

  defp reach(so?, figures), do: {:reach, so?, figures.(so?), nil}
  defp keep(true, _wrong, figures), do: {:keep, true, figures, nil}
  defp keep(false, wrong, _figures), do: {:keep, false, wrong.(), nil}

  defp unformed(trial) do
    now? = RunLog.formed?(trial.run_log)
    {:keep, not now?, formation(now?, trial), nil}
  end

  defp formation(true, trial), do: "in formation, #{leader(trial)}"

  defp formation(false, trial),
    do: "not in formation: #{leader(trial)}; #{phases(trial, Trial.living(trial))}"

  defp leader(trial), do: "#{View.leader(trial) || "nobody"} leads"

  defp leads({part, []}), do: "nobody leads #{Enum.join(part, ", ")}"
  defp leads({part, leaders}), do: "#{Enum.join(leaders, " and ")} lead #{Enum.join(part, ", ")}"

  defp view({id, nil, epoch}), do: "#{id} follows nobody (epoch #{epoch || 0})"
  defp view({id, leader, epoch}), do: "#{id} names #{leader} (epoch #{epoch})"

  defp all(trial, who, so?) do
    robots = View.who(trial, who)
    so? = robots != [] and Enum.all?(robots, so?)
    reach(so?, fn _ -> phases(trial, robots) end)
  end

  defp never(who, phase, trial) do
    there = Enum.filter(View.who(trial, who), &(View.phase(trial, &1) == phase))
    keep(there == [], fn -> phases(trial, there) end, "never #{phase}")
  end

  defp phases(trial, robots), do: Enum.map_join(robots, ", ", &"#{&1} #{View.phase(trial, &1)}")

  defp says({id, []}), do: "#{id} says nothing of its place"
  defp says({id, words}), do: "#{id} says #{Enum.join(words, " and ")}"
end
