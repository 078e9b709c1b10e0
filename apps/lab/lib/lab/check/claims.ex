defmodule Lab.Check.Claims do
  @moduledoc """
  Judges `false_claim`: a leader that claims `formed` is right (`Lab.Trial.Claims`), then and 5 s later. Pure; fed every 100 ms, it
  judges at the end.

  A leader withdraws a claim when not all have been in place for 0.5 s (docs/architecture.md, table of times), and hears of it
  by a heartbeat, which comes every 0.2 s and may be under way for a while. A claim that is withdrawn within that time after
  it was looked at again was no longer true then, and known not to be: it is judged by its beginning alone.
  """
  @behaviour Lab.Check.Kind
  alias Lab.Check.Violation
  alias Lab.Moment
  alias Lab.Trial.Claims

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

  @impl Lab.Check.Kind
  def new(%{delay_ms: {_least, most}}),
    do: %__MODULE__{limit_ms: @later_ms + @unformed_ms + @beat_ms + most}

  # The trial made its step 100 ms before.
  @impl Lab.Check.Kind
  def note(_asked, moment, notes) do
    made_ms = moment.at_ms - 100
    leaders = for {id, %{role: :leads, formed: true}} <- Moment.said(moment), do: id
    {open, over} = Map.split(notes.open, leaders)
    ended = Map.new(over, fn {id, since_ms} -> {{id, since_ms}, made_ms} end)
    open = Map.merge(Map.new(leaders, &{&1, made_ms}), open)
    {:never, [], %{notes | open: open, ended: Map.merge(notes.ended, ended)}}
  end

  @impl Lab.Check.Kind
  def finish(notes, %{claims: claims}) do
    for %{robot: leader, at_s: at_s} = claim <- claims, right?(notes, claim) == false do
      figures =
        Enum.map_join([{"then", claim.worst_m}, {"5 s later", claim.worst_5s_m}], ", ", fn
          {when?, nil} -> "? m #{when?}"
          {when?, metres} -> "#{Violation.decimals(metres, 2)} m #{when?}"
        end)

      Violation.new(:false_claim, round(at_s * 1000), [leader], "worst robot " <> figures)
    end
  end

  @doc "Whether a claim was true (`Lab.Trial.Claims.right?/1`), `nil` if there is nothing to judge."
  @spec right?(t(), Claims.claim()) :: boolean() | nil
  def right?(notes, %{robot: leader, at_s: at_s} = claim) do
    since_ms = round(at_s * 1000)

    case notes.ended do
      %{{^leader, ^since_ms} => ended_ms} when ended_ms - since_ms <= notes.limit_ms ->
        Claims.right?(%{claim | worst_5s_m: nil})

      _stands ->
        Claims.right?(claim)
    end
  end
end
