defmodule Sim.Scenario.Check.Fleet do
  @moduledoc false
  # Judges expectations about the fleet: who leads, what robots claim, in which phase they are. Pure;
  # answers are those of `Sim.Scenario.Check`.
  alias Sim.Scenario.{Check, Expectation, View}
  alias Sim.Trial.RunLog

  @doc "The answer at this tick; `memory` is what the last one returned, at first `nil`."
  @spec judge(Expectation.t(), View.t(), memory :: term()) :: Check.answer()
  def judge({:formed, _by}, view, _),
    do: reach(RunLog.formed?(view.run_log), fn so? -> formation(so?, view) end)

  def judge({:not_formed}, view, _), do: unformed(view)
  def judge({:not_formed, _window}, view, _), do: unformed(view)

  # Whether the formation was left in this window. One that was never left is enough at its end.
  def judge({:formed_again, within}, view, left?) do
    now? = RunLog.formed?(view.run_log)
    left? = left? == true or not now?
    last? = View.at_s(view) >= within[:after_s] + within[:within_s]
    {:reach, now? and (left? or last?), formation(now?, view), left?}
  end

  def judge({:leader, _by}, view, _),
    do: reach(View.leader(view) != nil, fn _ -> leader(view) end)

  def judge({:leader_changed, _within}, view, first) do
    first = first || {:at_first, View.leader(view)}
    {:at_first, before} = first
    now = View.leader(view)

    {:reach, now not in [nil, before], "#{leader(view)}, at first #{before || "nobody"} did",
     first}
  end

  def judge({:same_leader, _window}, view, first) do
    first = first || {:at_first, View.leader(view)}
    {:at_first, before} = first
    so? = before != nil and View.leader(view) == before
    {:keep, so?, "#{leader(view)}, at first #{before || "nobody"} did", first}
  end

  def judge({:one_leader, _window}, view, _) do
    wrong = for {_part, leaders} = row <- View.leaders(view), length(leaders) != 1, do: row
    keep(wrong == [], fn -> Enum.map_join(wrong, "; ", &leads/1) end, "one in each part")
  end

  def judge({:at_most_one_leader, grace}, view, _) do
    worst_s = view.run_log.agreement.rivals_worst_ms / 1000
    {:keep, worst_s <= grace[:grace_s], "two leaders in one part for #{worst_s} s at most", nil}
  end

  def judge({:agreed, _by}, view, _) do
    named = for {id, claim} <- view.claims, do: {id, claim[:leader], claim[:epoch]}
    views = Enum.uniq(for {_id, leader, epoch} <- named, do: {leader, epoch})
    so? = match?([{leader, _epoch}] when leader != nil, views)
    reach(so?, fn _ -> Enum.map_join(named, ", ", &view/1) end)
  end

  def judge({:rest, _by}, view, _), do: all(view, :all, &(View.role(view, &1) == :rests))

  def judge({:phase, who, phase, _by}, view, _),
    do: all(view, who, &(View.phase(view, &1) == phase))

  def judge({:never_phase, who, phase}, view, _), do: never(who, phase, view)
  def judge({:never_phase, who, phase, _window}, view, _), do: never(who, phase, view)

  def judge({:says, who, word, _by}, view, _) do
    robots = View.who(view, who) -- if who == :all, do: [View.leader(view)], else: []

    said =
      for {id, claim} <- view.claims,
          id in robots,
          do: {id, RunLog.account(view.run_log, claim).says}

    so? = said != [] and Enum.all?(said, fn {_id, words} -> word in words end)
    reach(so?, fn _ -> Enum.map_join(said, ", ", &says/1) end)
  end

  defp reach(so?, figures), do: {:reach, so?, figures.(so?), nil}
  defp keep(true, _wrong, figures), do: {:keep, true, figures, nil}
  defp keep(false, wrong, _figures), do: {:keep, false, wrong.(), nil}

  defp unformed(view) do
    now? = RunLog.formed?(view.run_log)
    {:keep, not now?, formation(now?, view), nil}
  end

  defp formation(true, view), do: "in formation, #{leader(view)}"

  defp formation(false, view),
    do: "not in formation: #{leader(view)}; #{phases(view, View.living(view))}"

  defp leader(view), do: "#{View.leader(view) || "nobody"} leads"

  defp leads({part, []}), do: "nobody leads #{Enum.join(part, ", ")}"
  defp leads({part, leaders}), do: "#{Enum.join(leaders, " and ")} lead #{Enum.join(part, ", ")}"

  defp view({id, nil, epoch}), do: "#{id} follows nobody (epoch #{epoch || 0})"
  defp view({id, leader, epoch}), do: "#{id} names #{leader} (epoch #{epoch})"

  defp all(view, who, so?) do
    robots = View.who(view, who)
    so? = robots != [] and Enum.all?(robots, so?)
    reach(so?, fn _ -> phases(view, robots) end)
  end

  defp never(who, phase, view) do
    there = Enum.filter(View.who(view, who), &(View.phase(view, &1) == phase))
    keep(there == [], fn -> phases(view, there) end, "never #{phase}")
  end

  defp phases(view, robots), do: Enum.map_join(robots, ", ", &"#{&1} #{View.phase(view, &1)}")

  defp says({id, []}), do: "#{id} says nothing of its place"
  defp says({id, words}), do: "#{id} says #{Enum.join(words, " and ")}"
end
