defmodule Sim.Invariants.Slots do
  @moduledoc """
  Judges that no two followers of one leader and epoch take the same slot. Pure; fed every 100 ms.

  | invariant | what must hold |
  |---|---|
  | `bad_anchor` | what a leader announces is valid: every follower once, every slot once (`Missions.Landmark.Reference.valid?/1`) |
  | `same_slot` | followers of one leader and epoch that have a fresh reference have different slots |

  An anchor is good for 1 s (docs/architecture.md, table of times), and a follower without a fresh one
  stands. So two followers may for 1 s, and for as long as letters are under way, believe a newer and an
  older order. The loss of messages does not make that longer: an anchor grows old by itself.
  """
  alias Missions.Landmark.State
  alias Sim.Invariants.Violation
  alias Missions.Landmark.Reference

  @fresh_ms 1_000
  # A reference is passed on along the chain, one tick a robot; relays have three at most.
  @slack_ms 300

  @enforce_keys [:limit_ms]
  defstruct @enforce_keys ++ [same: %{}]

  @type t :: %__MODULE__{limit_ms: pos_integer(), same: %{[atom()] => integer()}}

  @doc "The judge of a run with these options."
  @spec new(map()) :: t()
  def new(%{delay_ms: {_least, most}}),
    do: %__MODULE__{limit_ms: @fresh_ms + @slack_ms + 2 * most}

  @doc "One tick: the missions of the robots that can act."
  @spec note(t(), integer(), [{atom(), State.t()}]) :: {[Violation.t()], t()}
  def note(judge, at_ms, missions) do
    taken =
      for {id, mission} <- missions, slot = slot(mission, at_ms), reduce: %{} do
        taken -> Map.update(taken, slot, [id], &[id | &1])
      end

    same =
      for {_slot, [_, _ | _] = ids} <- taken, into: %{} do
        ids = Enum.sort(ids)
        {ids, Map.get(judge.same, ids, at_ms)}
      end

    late =
      for {ids, since} <- Enum.sort(same), at_ms - since > judge.limit_ms do
        Violation.new(
          :same_slot,
          at_ms,
          ids,
          "for #{Violation.decimals((at_ms - since) / 1000, 1)} s"
        )
      end

    {anchors(missions, at_ms) ++ late, %{judge | same: same}}
  end

  defp slot(%{phase: :follow, anchor: %Reference{} = anchor} = mission, at_ms)
       when at_ms - mission.anchor_ms <= @fresh_ms do
    case Enum.find_index(anchor.order, &(&1 == mission.me)) do
      nil ->
        nil

      index ->
        place = Enum.at(anchor.places, index)
        {anchor.leader, anchor.epoch, anchor.formation, anchor.size, anchor.trail != nil, place}
    end
  end

  defp slot(_other, _at_ms), do: nil

  defp anchors(missions, at_ms) do
    for {id, %{phase: :lead, anchor: %Reference{} = anchor}} <- missions,
        not Reference.valid?(anchor) do
      figures =
        "order #{inspect(anchor.order)}, places #{inspect(anchor.places)} of #{anchor.size}"

      Violation.new(:bad_anchor, at_ms, [id], figures)
    end
  end
end
