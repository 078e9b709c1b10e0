defmodule Lab.Check.Leaders do
  @moduledoc """
  Judges who leads, for each part of the radio (`Sim.Radio.parts/2`: robots that can reach each
  other, if necessary by way of others). Pure; fed every 100 ms.

  | invariant | what must hold |
  |---|---|
  | `two_leaders` | a part has one leader at most |
  | `same_epoch` | leaders of one part, both elected there, have different epochs |
  | `two_majorities` | with `policy: :majority`, one leader at most in the whole fleet, at any time |
  | `not_together` | in a part with a leader, all follow it, in its epoch |
  | `no_leader` | a part of which somebody has seen the landmark in the last 10 s has a leader |

  How long each may take follows from docs/times.md. The clock of a part
  starts again when a robot joins or leaves it.

  | | without loss | why |
  |---|---|---|
  | `two_leaders` | 1.8 s, once all have known each other for 2 s | a gone or new robot is known after 2 s; the leader's lease of 1.5 s; 0.3 s for letters under way. Measured: 0.66 s at most |
  | `not_together` | 10 s | 2 s until a robot is gone, 2 s a round for a change, 2.5 s until a round is given up, once more 2 s, 1.5 s the lease. Measured after healing: 1.2 s at most |
  | `no_leader` | 45 s | 11 s a scan, 30 s a round for a search, 2.5 s until it is given up. Measured first elections: within 15 s |

  If messages are lost, an answer needs a question that arrives and an answer that arrives, so all
  times are divided by (1 - loss)^2: by 1.56 at 20 %, where the published goal is 1.5; by 4 at 50 %.
  `same_epoch` and `two_majorities` are asked at every tick, whatever is lost.

  Robots that are not asked: one alone that has lost everybody (it stands, `lost_link`), one whose
  mission is ended by a stop, and a minority where a majority is needed.
  """
  @behaviour Lab.Check.Kind
  alias Lab.Check.Violation
  alias Lab.Moment
  alias Lab.Trial.RunLog

  @known_ms 2_000
  @two_ms 1_800
  @apart_ms 10_000
  @none_ms 45_000
  @seen_ms 10_000
  @enforce_keys [:robots, :factor, :majority]
  defstruct @enforce_keys ++ [parts: %{}, leading: %{}, seen: %{}]

  @typedoc """
  `parts` are the clocks of each part, `leading` since when and in which epoch a robot leads, `seen`
  when a robot last saw the landmark. `majority` is the size of the fleet of which one is needed.
  """
  @type t :: %__MODULE__{
          robots: pos_integer(),
          factor: float(),
          majority: pos_integer() | nil,
          parts: %{[atom()] => map()},
          leading: %{atom() => {integer(), integer()}},
          seen: %{atom() => integer()}
        }

  @impl Lab.Check.Kind
  def new(%{robots: robots, loss: loss} = options) do
    %__MODULE__{
      robots: length(robots),
      factor: factor(worst(loss, options)),
      majority: if(options.policy == :majority, do: options.of || length(robots))
    }
  end

  @doc "The greatest loss of a run: of its options, or of an event."
  @spec worst(number(), map()) :: number()
  def worst(loss, options) do
    for {_at_s, {:loss, share}} <- Map.get(options, :script, []), reduce: loss do
      worst -> max(worst, share)
    end
  end

  @doc """
  By how much longer agreement may take if this share of the messages is lost.

      iex> Lab.Check.Leaders.factor(0.5)
      4.0
  """
  @spec factor(number()) :: float()
  def factor(loss), do: 1 / max((1 - loss) * (1 - loss), 0.01)

  @impl Lab.Check.Kind
  def note(_asked, %{at_ms: at_ms} = moment, judge) do
    said = Moment.said(moment)
    claims = Map.new(said)

    judge = %{
      judge
      | leading: leading(judge.leading, claims, at_ms),
        seen: seen(judge, claims, moment)
    }

    {wrong, parts} =
      said
      |> RunLog.leaders(moment.parts)
      |> Enum.reduce({majorities(judge, at_ms), %{}}, fn {part, leaders}, {wrong, parts} ->
        clocks = Map.get(judge.parts, part, %{since: at_ms})
        {more, clocks} = judge(judge, part, leaders, clocks, claims, at_ms)
        {wrong ++ more, Map.put(parts, part, clocks)}
      end)

    {:never, wrong, %{judge | parts: parts}}
  end

  defp leading(leading, claims, at_ms) do
    for {id, %{role: :leads} = claim} <- claims, epoch = claim[:epoch] || 0, into: %{} do
      case leading do
        %{^id => {_since, ^epoch} = same} -> {id, same}
        _new -> {id, {at_ms, epoch}}
      end
    end
  end

  defp seen(judge, claims, %{at_ms: at_ms, run_log: log}) do
    for {id, %{role: _of_this_mission} = claim} <- claims,
        RunLog.account(log, claim).sight != nil,
        into: judge.seen,
        do: {id, at_ms}
  end

  defp majorities(%{majority: nil}, _at_ms), do: []

  defp majorities(%{leading: leading}, at_ms) when map_size(leading) > 1 do
    epochs = for {id, {_since, epoch}} <- Enum.sort(leading), do: "#{id} in epoch #{epoch}"
    [Violation.new(:two_majorities, at_ms, Map.keys(leading), Enum.join(epochs, ", "))]
  end

  defp majorities(_judge, _at_ms), do: []

  defp judge(judge, part, leaders, clocks, claims, at_ms) do
    active = for id <- part, takes_part?(claims[id]), do: id

    clocks =
      clocks
      |> clock(:two, length(leaders) > 1, at_ms)
      |> clock(:apart, leaders != [] and apart?(active, leaders, claims), at_ms)
      |> clock(:none, leaders == [] and asked?(judge, active, at_ms), at_ms)

    known_ms = clocks.since + round(@known_ms * judge.factor)
    two_ms = late(clocks.two && max(clocks.two, known_ms), at_ms, @two_ms, judge)
    apart_ms = late(clocks.apart, at_ms, @apart_ms, judge)
    none_ms = late(clocks.none, at_ms, @none_ms, judge)

    wrong =
      epochs(judge, leaders, known_ms, at_ms) ++
        if(two_ms, do: [two(leaders, two_ms, at_ms)], else: []) ++
        if(apart_ms, do: [apart(active, apart_ms, claims, at_ms)], else: []) ++
        if none_ms, do: [none(active, none_ms, claims, at_ms)], else: []

    {wrong, clocks}
  end

  # A robot whose mission is over, or another one, claims nothing of it.
  defp takes_part?(%{phase: phase}), do: phase != :idle
  defp takes_part?(_other), do: false

  defp clock(clocks, name, true, at_ms), do: Map.put(clocks, name, clocks[name] || at_ms)
  defp clock(clocks, name, false, _at_ms), do: Map.put(clocks, name, nil)

  defp late(nil, _at_ms, _limit_ms, _judge), do: nil

  defp late(since, at_ms, limit_ms, judge),
    do: if(at_ms - since > limit_ms * judge.factor, do: at_ms - since)

  defp apart?(active, [leader | _], claims) do
    epoch = claims[leader][:epoch]

    Enum.any?(active, fn id ->
      claim = claims[id]
      role = if id == leader, do: :leads, else: :follows
      {claim.role, claim[:leader], claim[:epoch]} != {role, leader, epoch}
    end)
  end

  defp asked?(judge, active, at_ms) do
    enough? = judge.majority == nil or 2 * length(active) > judge.majority
    alone? = length(active) < 2 and judge.robots > 1

    enough? and not alone? and active != [] and
      Enum.any?(active, &(at_ms - Map.get(judge.seen, &1, -@seen_ms - 1) <= @seen_ms))
  end

  defp epochs(judge, leaders, known_ms, at_ms) do
    for a <- leaders,
        b <- leaders,
        a < b,
        {{since, epoch}, {later, epoch}} <- [{judge.leading[a], judge.leading[b]}],
        min(since, later) > known_ms,
        do: Violation.new(:same_epoch, at_ms, [a, b], "both lead in epoch #{epoch}")
  end

  defp two(leaders, ms, at_ms),
    do: Violation.new(:two_leaders, at_ms, leaders, "for #{seconds(ms)} s")

  defp apart(active, ms, claims, at_ms),
    do:
      Violation.new(:not_together, at_ms, active, "for #{seconds(ms)} s: #{says(active, claims)}")

  defp none(active, ms, claims, at_ms),
    do: Violation.new(:no_leader, at_ms, active, "for #{seconds(ms)} s: #{says(active, claims)}")

  defp says(active, claims) do
    Enum.map_join(active, ", ", fn id ->
      claim = claims[id]
      "#{id} #{claim.phase} of #{claim[:leader] || "nobody"} in #{claim[:epoch] || "no epoch"}"
    end)
  end

  defp seconds(ms), do: Violation.decimals(ms / 1000, 1)
end
