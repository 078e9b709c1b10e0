defmodule Agents.ContractNet.Manager do
  @moduledoc """
  Assigns one task to the lowest bidder. Pure; time is passed in, in milliseconds.

      announce --all have bid, or 0.5 s--> award --done--> over
         ^                                   |
         |--- no bids, winner gone, ---------|
         |    failed, or silent for 5 s      |
         '--- all that can are busy: pause --'

  The smallest `{cost, peer}` wins, so that the order of answers does not matter. Each
  announcement is a *round* with a number, which all its letters carry. A winner that failed is
  not asked again.

  Peers that are busy, or bound by a bid to another manager, are asked again after a pause, which differs
  from one manager to the next and grows: managers that began at once would otherwise meet again each
  time. This goes on for `:wait_ms`, and does not count among the rounds; then the outcome is `:busy`.

  If a winner that was given up reports after all, it is told to stop; if it has
  done the task, the task is done, and a peer that is doing it now is told to stop. A task may be done
  twice, but never not at all while a peer can do it: do not auction what must happen at most
  once.

  `start/5` takes `:bid_ms` (500), `:silence_ms` (5000), `:rounds` (3), the number of announcements, and
  `:wait_ms` (5000). Functions return the letters to send, `{peer, performative, content}`.
  """
  alias Swarm.Wire

  # The range that a pause is drawn from, ms: it doubles with each pause.
  @pause_ms 40
  @longest_pause_ms 320

  @enforce_keys [:task, :peers, :bid_ms, :silence_ms, :rounds, :wait_ms, :until_ms, :salt]
  defstruct @enforce_keys ++
              [
                phase: :bidding,
                round: 0,
                pauses: 0,
                bids: %{},
                winner: nil,
                awarded: [],
                due_ms: 0,
                outcome: nil
              ]

  @type peer :: term()
  @type letter :: {peer(), Agents.Envelope.performative(), content :: term()}
  @type outcome ::
          {:ok, winner :: peer(), result :: term()}
          | {:error, :nobody | :no_bids | :busy | :given_up}
  @typedoc """
  `due_ms` is when time alone changes something; `bids` holds a cost, `:refused` or `:busy` for each
  peer; `awarded` lists all that ever won; `round` counts the announcements, and `pauses` those of them
  that followed a pause; until `until_ms` busy peers are asked again; `salt` makes the pauses of one
  manager differ from those of others.
  """
  @type t :: %__MODULE__{
          task: term(),
          peers: [peer()],
          bid_ms: pos_integer(),
          silence_ms: pos_integer(),
          rounds: pos_integer(),
          wait_ms: pos_integer(),
          until_ms: integer(),
          salt: term(),
          phase: :bidding | :pausing | :working | :over,
          round: non_neg_integer(),
          pauses: non_neg_integer(),
          bids: %{peer() => number() | :refused | :busy},
          winner: peer() | nil,
          awarded: [peer()],
          due_ms: integer(),
          outcome: outcome() | nil
        }

  @doc "Announces a task; `salt` is a term that no other manager has, such as its conversation."
  @spec start(term(), [peer()], keyword(), integer(), salt :: term()) :: {t(), [letter()]}
  def start(task, peers, options, now_ms, salt \\ nil) do
    options = options!(options)
    fields = [task: task, peers: Enum.sort(Enum.uniq(peers)), salt: salt]
    fields = fields ++ [until_ms: now_ms + options[:wait_ms]] ++ options
    announce(struct!(__MODULE__, fields), :nobody, now_ms)
  end

  @doc "Fills in the options of a manager; wrong ones raise `ArgumentError`."
  @spec options!(keyword()) :: keyword()
  def options!(options) do
    defaults = [bid_ms: 500, silence_ms: 5_000, rounds: 3, wait_ms: 5_000]
    options = Keyword.validate!(options, defaults)

    for {option, value} <- options, not (Wire.ms?(value) and value > 0) do
      raise ArgumentError,
            "#{option}: expected a whole number above 0, ms up to a day, got #{inspect(value, limit: 5)}"
    end

    options
  end

  @doc "A letter came from one of the peers. A letter that makes no sense changes nothing."
  @spec hear(t(), peer(), Agents.Envelope.performative(), term(), integer()) :: {t(), [letter()]}
  def hear(%{phase: :bidding, round: round} = m, peer, :propose, {round, cost}, now_ms)
      when is_number(cost),
      do: bid(m, peer, cost, now_ms)

  # The peer waits for an answer, and without one its bid would bind it for nothing.
  def hear(m, peer, :propose, {round, _cost}, _now_ms), do: {m, [{peer, :reject, round}]}

  def hear(%{phase: :bidding, round: round} = m, peer, :refuse, {round, why}, now_ms)
      when why in [:busy, :locked],
      do: bid(m, peer, :busy, now_ms)

  def hear(%{phase: :bidding, round: round} = m, peer, :refuse, {round, _why}, now_ms),
    do: bid(m, peer, :refused, now_ms)

  def hear(%{phase: :over} = m, peer, :inform, {round, :progress, _note}, _now_ms),
    do: {m, [{peer, :cancel, round}]}

  def hear(%{phase: :over} = m, _peer, _performative, _content, _now_ms), do: {m, []}

  def hear(%{phase: :bidding} = m, peer, :failure, _why, now_ms),
    do: bid(m, peer, :refused, now_ms)

  def hear(m, peer, :inform, {_round, :done, result}, _now_ms) do
    letters = for {other, told} <- bound(m), other != peer, do: {other, told, m.round}

    if peer in m.awarded,
      do: {%{m | phase: :over, outcome: {:ok, peer, result}}, letters},
      else: {m, []}
  end

  def hear(
        %{phase: :working, winner: peer, round: round} = m,
        peer,
        performative,
        content,
        now_ms
      ) do
    case {performative, content} do
      {:agree, ^round} -> {%{m | due_ms: now_ms + m.silence_ms}, []}
      {:inform, {^round, :progress, _note}} -> {%{m | due_ms: now_ms + m.silence_ms}, []}
      {:refuse, {^round, _why}} -> announce(m, :given_up, now_ms)
      {:failure, {^round, _why}} -> m |> without(peer) |> announce(:given_up, now_ms)
      # The peer could not even read the letter.
      {:failure, :error} -> m |> without(peer) |> announce(:given_up, now_ms)
      _other -> {m, []}
    end
  end

  def hear(m, peer, :inform, {round, :progress, _note}, _now_ms),
    do: {m, [{peer, :cancel, round}]}

  def hear(m, _peer, _performative, _content, _now_ms), do: {m, []}

  @doc "A peer has gone, or cannot be reached."
  @spec gone(t(), peer(), integer()) :: {t(), [letter()]}
  def gone(%{phase: :over} = m, _peer, _now_ms), do: {m, []}

  def gone(%{phase: :working, winner: peer} = m, peer, now_ms),
    do: m |> without(peer) |> announce(:given_up, now_ms)

  def gone(m, peer, now_ms), do: m |> without(peer) |> decide(now_ms)

  @doc "Time has passed; call it at `due_ms`."
  @spec tick(t(), integer()) :: {t(), [letter()]}
  def tick(%{due_ms: due_ms} = m, now_ms) when now_ms < due_ms, do: {m, []}
  def tick(%{phase: :over} = m, _now_ms), do: {m, []}

  def tick(%{phase: :bidding} = m, now_ms) do
    case best(m) do
      nil -> if busy?(m), do: pause(m, now_ms), else: announce(m, :no_bids, now_ms)
      winner -> award(m, winner, now_ms)
    end
  end

  def tick(%{phase: :pausing} = m, now_ms),
    do: announce(%{m | pauses: m.pauses + 1}, :busy, now_ms)

  def tick(%{phase: :working, winner: winner} = m, now_ms) do
    cancel = {winner, :cancel, m.round}
    {m, letters} = m |> without(winner) |> announce(:given_up, now_ms)
    {m, [cancel | letters]}
  end

  defp bid(m, peer, cost, now_ms) do
    if peer in m.peers,
      do: decide(%{m | bids: Map.put_new(m.bids, peer, cost)}, now_ms),
      else: {m, []}
  end

  # Bidding closes before the deadline only if all have answered, and one bids or is busy: what no peer can do now
  # one may be able to do in the next round.
  defp decide(%{phase: :bidding} = m, now_ms) do
    winner = best(m)

    cond do
      m.peers == [] -> over(m, :nobody)
      not Enum.all?(m.peers, &is_map_key(m.bids, &1)) -> {m, []}
      winner != nil -> award(m, winner, now_ms)
      busy?(m) -> pause(m, now_ms)
      true -> {m, []}
    end
  end

  defp decide(m, _now_ms), do: {m, []}

  defp best(m) do
    bids = for {peer, cost} <- m.bids, is_number(cost), do: {cost, peer}
    with {_cost, peer} <- Enum.min(bids, fn -> nil end), do: peer
  end

  defp busy?(m), do: Enum.any?(m.bids, fn {_peer, cost} -> cost == :busy end)

  defp pause(m, now_ms) do
    range_ms = min(@pause_ms * 2 ** min(m.pauses, 8), @longest_pause_ms)
    due_ms = now_ms + div(range_ms, 4) + :erlang.phash2({m.salt, m.round}, range_ms)

    if due_ms > m.until_ms,
      do: over(m, :busy),
      else: {%{m | phase: :pausing, due_ms: due_ms}, []}
  end

  defp award(m, winner, now_ms) do
    others =
      for {peer, cost} <- m.bids, is_number(cost), peer != winner, do: {peer, :reject, m.round}

    m = %{m | phase: :working, winner: winner, due_ms: now_ms + m.silence_ms}
    m = %{m | awarded: [winner | m.awarded]}
    {m, [{winner, :accept, m.round} | others]}
  end

  defp announce(%{round: round, rounds: rounds, pauses: pauses} = m, why, _now_ms)
       when round - pauses >= rounds,
       do: over(m, why)

  defp announce(%{peers: []} = m, _why, _now_ms), do: over(m, :nobody)

  defp announce(m, _why, now_ms) do
    round = m.round + 1
    due_ms = now_ms + m.bid_ms
    m = %{m | phase: :bidding, round: round, bids: %{}, winner: nil, due_ms: due_ms}
    {m, for(peer <- m.peers, do: {peer, :cfp, {round, m.task, m.bid_ms}})}
  end

  defp over(m, why), do: {%{m | phase: :over, outcome: {:error, why}}, []}

  defp without(m, peer),
    do: %{m | peers: List.delete(m.peers, peer), bids: Map.delete(m.bids, peer)}

  # The peers bound to this manager now, and what to send to release them.
  defp bound(%{phase: :working} = m), do: [{m.winner, :cancel}]
  defp bound(m), do: for({peer, cost} <- m.bids, is_number(cost), do: {peer, :reject})
end
