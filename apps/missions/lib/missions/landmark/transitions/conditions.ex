defmodule Missions.Landmark.Transitions.Conditions do
  @moduledoc "Decides which conditions of `Missions.Landmark.Transitions` hold for a robot now. Pure."
  alias Missions.Landmark
  alias Missions.Landmark.{Leader, Lookout, Policy, ReferenceInbox, Rounds, Transitions}
  alias Swarm.Agreement.Round

  @roam_ms 6_000
  @tries 3
  # A leader without a sign of life for this long is lost.
  @led_ms 2_000

  @doc "Whether the condition holds for a robot's mission."
  @spec holds?(Transitions.condition(), Landmark.State.t()) :: boolean()
  def holds?(:started, m), do: m.started?
  def holds?(:elected, m), do: m.verdict == {:leader, m.me}

  def holds?(:led, m),
    do: match?({:leader, other} when other != m.me, m.verdict) or ReferenceInbox.joined?(m)

  def holds?(:nobody, m), do: m.verdict == :nobody

  def holds?(:nobody_again, m) do
    over? = if Lookout.alone?(m), do: not Lookout.left?(m), else: m.tries + 1 >= @tries
    m.verdict == :nobody and over?
  end

  def holds?(:more, m), do: turned?(m) and Lookout.left?(m)
  def holds?(:no_more, m), do: turned?(m) and not Lookout.left?(m)
  def holds?(:scanned, m), do: m.scan != nil
  def holds?(:scan_wanted, m), do: m.scan == nil and Rounds.search?(m)
  def holds?(:sighted, m), do: Landmark.State.sees?(m) or Rounds.search?(m)

  def holds?(:roamed, m) do
    if Lookout.left?(m), do: Lookout.arrived?(m), else: m.now_ms - m.since_ms >= @roam_ms
  end

  def holds?(:deposed, m), do: Leader.deposed?(m)

  def holds?(:superseded, m),
    do: m.anchor != nil and m.anchor.epoch > m.epoch and ReferenceInbox.joined?(m)

  def holds?(:round_open, m), do: Round.open?(m.round)
  def holds?(:lost_stop, m), do: Policy.lost?(m) and Policy.lost_link(m) == :stop
  def holds?(:lost_hold, m), do: Policy.lost?(m) and Policy.lost_link(m) == :hold
  def holds?(:company, m), do: Policy.company?(m)

  # A robot that has a leader leaves the decision to the leader.
  def holds?(:short, %{phase: :follow} = m) when m.now_ms - m.since_ms < @led_ms, do: false

  def holds?(:short, %{phase: :follow, anchor_ms: at_ms, now_ms: now})
      when now - at_ms < @led_ms,
      do: false

  def holds?(:short, m), do: not Round.open?(m.round) and Policy.short?(m, together(m))
  def holds?(:enough, m), do: Policy.enough?(m, together(m))

  # A robot on its way has turned before, and may learn that others have looked at the rest.
  defp turned?(m),
    do:
      Lookout.alone?(m) and not Round.open?(m.round) and
        (m.scan == :nothing or m.phase == :wander)

  defp together(m), do: length(Rounds.view(m))
end
