defmodule Swarm.Message.Forwarder do
  @moduledoc """
  Forwards messages between robots that do not hear each other, so that robots that are connected only through
  others act as one group. Pure.

  The heartbeat of each robot lists the robots that it hears. If one robot's list lacks another
  for a while, a robot in contact with both forwards the heartbeats and letters of the
  latter directly to the former: those of rounds to their view, and those of missions to their addressees
  (`Robot.Mission.Letter`). If several could, the first two by name do. Letters go through
  three relays at most; heartbeats stop where they are known. A relayed message counts as a sign
  of life, but not as heard, so that the forwarding goes on as long as it is needed.
  """
  alias Robot.Mission
  alias Swarm.Agreement.Round
  alias Swarm.Message
  alias Swarm.Membership.{Heartbeat, NameSet}

  # A robot that has just joined is not in any list yet.
  @patience_ms 300
  # Letters of rounds are repeated every 100 ms; the same letter arrives more often by several ways.
  @repeat_ms 90
  @alive_ms 1_000
  @relays 2

  defstruct missing: %{}, beats: %{}, letters: %{}, heard: {[], <<>>}

  @typedoc """
  `heard` has the robots that are heard now, sorted, and the set of these and of this one; it seldom changes. `missing`
  says since when a robot (the second of the pair) has not heard another; `beats` and
  `letters` say what was last forwarded from which robot to which.
  """
  @type t :: %__MODULE__{
          missing: %{{atom(), atom()} => integer()},
          beats: %{{atom(), atom()} => {integer(), integer()}},
          letters: %{{atom(), atom()} => {non_neg_integer(), integer()}},
          heard: {[atom()], NameSet.t()}
        }

  @typedoc "The robots that were heard of: their newest heartbeats, and when they were heard (`Swarm.Membership.Peers`)."
  @type peers :: %{
          atom() => %{
            :beat => Heartbeat.t(),
            :at_ms => integer(),
            :direct_ms => integer() | nil,
            optional(atom()) => term()
          }
        }

  @typedoc "One message, and to which robots it goes."
  @type sending :: {:send, [atom()], Message.t()}

  @doc "The state before anything is forwarded."
  @spec new() :: t()
  def new, do: %__MODULE__{}

  @doc "The heartbeats to forward now, as `{:send, [to], message}`."
  @spec beats(t(), atom(), peers(), integer()) :: {t(), [sending()]}
  def beats(relay, me, peers, now_ms) do
    {names, all} = heard = heard(relay.heard, me, peers, now_ms)

    pairs =
      for to <- names,
          %{^to => %{beat: %{heard: roll}}} = peers,
          not NameSet.all_but?(roll, all, to),
          NameSet.member?(roll, me),
          from <- names -- NameSet.names(roll),
          from != to,
          do: {from, to}

    if pairs == [] and relay.missing == %{},
      do: {%{relay | heard: heard}, []},
      else: forward(%{relay | heard: heard}, me, peers, pairs, now_ms)
  end

  # Those that are heard now, and the set of these and of this robot: mostly the same as before.
  defp heard({names, _all} = before, me, peers, now_ms) do
    ids = for {id, peer} <- Map.to_list(peers), alive?(peer, now_ms), do: id

    if length(ids) == length(names) and Enum.all?(names, &known?(peers, &1, now_ms)) do
      before
    else
      names = Enum.sort(ids)
      {names, NameSet.new([me | names])}
    end
  end

  defp known?(peers, id, now_ms) do
    case peers do
      %{^id => peer} -> alive?(peer, now_ms)
      _never_heard -> false
    end
  end

  defp forward(relay, me, peers, pairs, now_ms) do
    {names, _all} = relay.heard
    alive = Map.take(peers, names)
    missing = Map.new(pairs, &{&1, Map.get(relay.missing, &1, now_ms)})

    relay = %{
      relay
      | missing: missing,
        beats: Map.take(relay.beats, pairs),
        letters: Map.take(relay.letters, pairs)
    }

    for {from, to} = pair <- pairs,
        now_ms - missing[pair] >= @patience_ms,
        mine?(me, from, to, alive, now_ms),
        reduce: {relay, []} do
      {relay, sent} -> beat(relay, me, pair, alive[from], sent)
    end
  end

  defp beat(relay, me, {from, to} = pair, %{beat: beat} = peer, sent) do
    number = {beat.boot, beat.sequence}
    # The number of relays is not known here: a robot that is not heard itself was relayed at
    # least once.
    hops = if peer.direct_ms == peer.at_ms, do: 0, else: 2
    message = %{Message.new(from, :heartbeat, beat) | hops: hops}

    with true <- relay.beats[pair] != number,
         {:ok, relayed} <- Message.pass_on(message, me) do
      {put_in(relay.beats[pair], number), [{:send, [to], relayed} | sent]}
    else
      _told_already -> {relay, sent}
    end
  end

  @doc """
  The same for a letter that was heard just now, for those of its addressees that do not hear its
  sender. Messages that are for the robots alone that were sent them are not forwarded.
  """
  @spec letter(t(), atom(), peers(), Message.t(), integer()) ::
          {t(), [sending()]}
  def letter(%{missing: missing} = relay, _me, _peers, _message, _now_ms) when missing == %{},
    do: {relay, []}

  def letter(relay, me, peers, %Message{kind: kind, from: from, body: body} = message, now_ms)
      when kind in [:round, :mission] do
    content = content(body)

    for to <- Enum.sort(for {{^from, to}, _since_ms} <- relay.missing, do: to),
        addressed?(body, to),
        fresh?(relay.letters[{from, to}], content, now_ms),
        mine?(me, from, to, peers, now_ms),
        {:ok, relayed} <- [Message.pass_on(message, me)],
        reduce: {relay, []} do
      {relay, sent} ->
        {put_in(relay.letters[{from, to}], {content, now_ms}), [{:send, [to], relayed} | sent]}
    end
  end

  def letter(relay, _me, _peers, _message, _now_ms), do: {relay, []}

  defp content(%Round.Letter{} = letter), do: :erlang.phash2(%{letter | remaining_ms: 0})
  defp content(%Mission.Letter{} = letter), do: :erlang.phash2(letter)

  defp addressed?(%Round.Letter{view: view}, to), do: to in view
  defp addressed?(%Mission.Letter{} = letter, to), do: Mission.Letter.to?(letter, to)

  defp fresh?({content, at_ms}, content, now_ms), do: now_ms - at_ms >= @repeat_ms
  defp fresh?(_other, _content, _now_ms), do: true

  # The first robots that hear the sender and are heard by the receiver forward; if there are
  # none, all robots that have the message by a relay do.
  defp mine?(me, from, to, peers, now_ms) do
    ways =
      Stream.filter(peers, fn {id, peer} ->
        id not in [from, to] and alive?(peer, now_ms) and
          NameSet.member?(peer.beat.heard, from) and NameSet.member?(peers[to].beat.heard, id)
      end)

    # Not all ways are looked for: in a large group nearly every robot is one.
    if heard?(peers[from], now_ms),
      do: Enum.count(Stream.take(Stream.filter(ways, &(elem(&1, 0) < me)), @relays)) < @relays,
      else: Enum.empty?(ways) and is_map_key(peers, from)
  end

  defp heard?(%{direct_ms: at_ms}, now_ms) when at_ms != nil, do: now_ms - at_ms < @alive_ms
  defp heard?(_relayed_or_unknown, _now_ms), do: false

  defp alive?(%{at_ms: at_ms, beat: %Heartbeat{}}, now_ms), do: now_ms - at_ms < @alive_ms
  defp alive?(_silent, _now_ms), do: false
end
