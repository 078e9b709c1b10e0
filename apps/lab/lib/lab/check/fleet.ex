defmodule Lab.Check.Fleet do
  @moduledoc false
  # Judges expectations about the fleet: who leads, what robots claim, in which phase they are. Pure;
  # answers are those of `Lab.Check.Kind`.
  @behaviour Lab.Check.Kind
  alias Lab.Moment
  alias Lab.Trial.RunLog

  @impl Lab.Check.Kind
  def new(_options), do: nil

  @impl Lab.Check.Kind
  def note({:formed, _by}, moment, _),
    do: reach(RunLog.formed?(moment.run_log), fn so? -> formation(so?, moment) end)

  def note({:not_formed, _window}, moment, _) do
    now? = RunLog.formed?(moment.run_log)
    {:keep, not now?, formation(now?, moment), nil}
  end

  # Whether the formation was left in this window. One that was never left is enough at its end.
  def note({:formed_again, within}, moment, left?) do
    now? = RunLog.formed?(moment.run_log)
    left? = left? == true or not now?
    last? = Moment.at_s(moment) >= within[:after_s] + within[:within_s]
    {:reach, now? and (left? or last?), formation(now?, moment), left?}
  end

  def note({:leader, _by}, moment, _),
    do: reach(RunLog.leader(moment.run_log) != nil, fn _ -> leader(moment) end)

  def note({:leader_changed, _within}, moment, first) do
    first = first || {:at_first, RunLog.leader(moment.run_log)}
    {:at_first, before} = first
    now = RunLog.leader(moment.run_log)

    {:reach, now not in [nil, before], "#{leader(moment)}, at first #{before || "nobody"} did",
     first}
  end

  def note({:same_leader, _window}, moment, first) do
    first = first || {:at_first, RunLog.leader(moment.run_log)}
    {:at_first, before} = first
    so? = before != nil and RunLog.leader(moment.run_log) == before
    {:keep, so?, "#{leader(moment)}, at first #{before || "nobody"} did", first}
  end

  def note({:one_leader, _window}, moment, _) do
    wrong = for {_part, leaders} = row <- Moment.leaders(moment), length(leaders) != 1, do: row
    keep(wrong == [], fn -> Enum.map_join(wrong, "; ", &leads/1) end, "one in each part")
  end

  def note({:at_most_one_leader, grace}, moment, _) do
    worst_s = moment.run_log.agreement.rivals_worst_ms / 1000
    {:keep, worst_s <= grace[:grace_s], "two leaders in one part for #{worst_s} s at most", nil}
  end

  def note({:agreed, _by}, moment, _) do
    named = for {id, claim} <- moment.claims, do: {id, claim[:leader], claim[:epoch]}
    views = Enum.uniq(for {_id, leader, epoch} <- named, do: {leader, epoch})
    so? = match?([{leader, _epoch}] when leader != nil, views)
    reach(so?, fn _ -> Enum.map_join(named, ", ", &names/1) end)
  end

  def note({:rest, _by}, moment, _), do: all(moment, :all, &(Moment.role(moment, &1) == :rests))

  def note({:phase, who, phase, _by}, moment, _),
    do: all(moment, who, &(Moment.phase(moment, &1) == phase))

  def note({:never_phase, who, phase, _window}, moment, _) do
    there = Enum.filter(Moment.who(moment, who), &(Moment.phase(moment, &1) == phase))
    keep(there == [], fn -> phases(moment, there) end, "never #{phase}")
  end

  def note({:says, who, word, _by}, moment, _) do
    robots =
      Moment.who(moment, who) -- if who == :all, do: [RunLog.leader(moment.run_log)], else: []

    said =
      for {id, claim} <- moment.claims,
          id in robots,
          do: {id, RunLog.account(moment.run_log, claim).says}

    so? = said != [] and Enum.all?(said, fn {_id, words} -> word in words end)
    reach(so?, fn _ -> Enum.map_join(said, ", ", &says/1) end)
  end

  defp reach(so?, figures), do: {:reach, so?, figures.(so?), nil}
  defp keep(true, _wrong, figures), do: {:keep, true, figures, nil}
  defp keep(false, wrong, _figures), do: {:keep, false, wrong.(), nil}

  defp formation(true, moment), do: "in formation, #{leader(moment)}"

  defp formation(false, moment),
    do: "not in formation: #{leader(moment)}; #{phases(moment, Moment.who(moment, :all))}"

  defp leader(moment), do: "#{RunLog.leader(moment.run_log) || "no robot"} leads"

  defp leads({part, []}), do: "no robot leads #{Enum.join(part, ", ")}"
  defp leads({part, leaders}), do: "#{Enum.join(leaders, " and ")} lead #{Enum.join(part, ", ")}"

  defp names({id, nil, epoch}), do: "#{id} follows no robot (epoch #{epoch || 0})"
  defp names({id, leader, epoch}), do: "#{id} names #{leader} (epoch #{epoch})"

  defp all(moment, who, so?) do
    robots = Moment.who(moment, who)
    so? = robots != [] and Enum.all?(robots, so?)
    reach(so?, fn _ -> phases(moment, robots) end)
  end

  defp phases(moment, robots),
    do: Enum.map_join(robots, ", ", &"#{&1} #{Moment.phase(moment, &1)}")

  defp says({id, []}), do: "#{id} says nothing of its place"
  defp says({id, words}), do: "#{id} says #{Enum.join(words, " and ")}"
end
