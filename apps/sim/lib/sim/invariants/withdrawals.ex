defmodule Sim.Invariants.Withdrawals do
  @moduledoc false
  # Notes when claims of `formed` end, so that none is called false for the time that it takes to
  # withdraw it. Pure; fed every 100 ms.
  #
  # `Sim.Trial.Claims` looks again 5 s after a claim was made. A leader withdraws a claim when not all have
  # been in place for 0.5 s (docs/times.md), and hears of it by a heartbeat, which
  # comes every 0.2 s and may be under way for a while. A claim that is withdrawn within that time after
  # it was looked at again was no longer true then, and known not to be.

  @later_ms 5_000
  @unformed_ms 500
  @beat_ms 200

  @enforce_keys [:limit_ms]
  defstruct @enforce_keys ++ [open: %{}, ended: %{}]

  @typedoc "`open` is since when each leader claims `formed`; `ended` is when such a claim ended."
  @type t :: %__MODULE__{
          limit_ms: pos_integer(),
          open: %{atom() => integer()},
          ended: %{{atom(), since_ms :: integer()} => integer()}
        }

  @doc "The notes of a run with these options."
  @spec new(map()) :: t()
  def new(%{delay_ms: {_least, most}}),
    do: %__MODULE__{limit_ms: @later_ms + @unformed_ms + @beat_ms + most}

  @doc "One tick, after a step, which the trial made 100 ms before; each claim has its `role` (`t:Robot.Mission.role/0`)."
  @spec note(t(), integer(), [{atom(), map()}]) :: t()
  def note(notes, at_ms, claims) do
    made_ms = at_ms - 100
    leaders = for {id, %{role: :leads, formed: true}} <- claims, do: id
    {open, over} = Map.split(notes.open, leaders)
    ended = Map.new(over, fn {id, since_ms} -> {{id, since_ms}, made_ms} end)

    %{
      notes
      | open: Map.merge(Map.new(leaders, &{&1, made_ms}), open),
        ended: Map.merge(notes.ended, ended)
    }
  end

  @doc "Whether a claim was being withdrawn when it was judged for the second time."
  @spec withdrawn?(t(), Sim.Trial.Claims.claim()) :: boolean()
  def withdrawn?(notes, %{robot: leader, at_s: at_s}) do
    since_ms = round(at_s * 1000)

    case notes.ended do
      %{{^leader, ^since_ms} => ended_ms} -> ended_ms - since_ms <= notes.limit_ms
      _stands -> false
    end
  end
end
