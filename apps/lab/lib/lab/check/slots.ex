defmodule Lab.Check.Slots do
  @moduledoc """
  Judges that no two followers of one leader and epoch take the same slot. Pure; fed every 100 ms.

  | invariant | what must hold |
  |---|---|
  | `bad_anchor` | the places that a leader gives to others are valid (`c:Robot.Mission.place/2`) |
  | `same_slot` | robots do not take the same slot (`c:Robot.Mission.place/2`), as followers of one leader and epoch with a fresh reference |

  An anchor is good for 1 s (docs/times.md), and a follower without a fresh one
  stands. So two followers may for 1 s, and for as long as letters are under way, believe a newer and an
  older order. The loss of messages does not make that longer: an anchor grows old by itself.
  """
  @behaviour Lab.Check.Kind
  alias Lab.Check.Violation

  @fresh_ms 1_000
  # A reference is passed on along the chain, one tick a robot; relays have three at most.
  @slack_ms 300

  @enforce_keys [:limit_ms]
  defstruct @enforce_keys ++ [same: %{}]

  @type t :: %__MODULE__{limit_ms: pos_integer(), same: %{[atom()] => integer()}}

  @impl Lab.Check.Kind
  def new(%{delay_ms: {_least, most}}),
    do: %__MODULE__{limit_ms: @fresh_ms + @slack_ms + 2 * most}

  @impl Lab.Check.Kind
  def note(_asked, %{places: nil}, _judge), do: :unseen

  def note(_asked, %{at_ms: at_ms, places: places}, judge) do
    faults = for {id, {:fault, line}} <- places, do: Violation.new(:bad_anchor, at_ms, [id], line)

    taken = Enum.group_by(places, &elem(&1, 1), &elem(&1, 0))

    same =
      for {{:slot, _slot}, [_, _ | _] = ids} <- taken, into: %{} do
        ids = Enum.sort(ids)
        {ids, Map.get(judge.same, ids, at_ms)}
      end

    late =
      for {ids, since} <- Enum.sort(same), at_ms - since > judge.limit_ms do
        figures = "for #{Violation.decimals((at_ms - since) / 1000, 1)} s"
        Violation.new(:same_slot, at_ms, ids, figures)
      end

    {:never, faults ++ late, %{judge | same: same}}
  end
end
