defmodule Missions.Landmark.Policy do
  @moduledoc """
  Decides what a robot may do with the robots that it can reach. Pure.

  **Which part may lead.** `policy: :available` (the default): every part of a fleet leads itself.
  `policy: :majority, of: n`: only a part with more than half of `n` robots may lead; the others
  stand still until they are a majority again, and their leader abdicates within its lease. Of 4
  robots, 2 are not enough. A robot that a leader may still count on does not report in a round
  without this leader until that lease is over, so that no other robot leads before then. The
  number `n` travels in every report, of which the greatest counts, so that all of a part decide
  alike; and in the anchor, for a robot that joins without a round. It believes a greater number
  only once its leader has said it in five anchors, because one wrong anchor must not keep a fleet
  from electing.

  **Lost link.** A robot that was with others in this mission, and has heard none for 2 s, does
  what `lost_link` says until it hears one:

  | `lost_link` | what it does |
  |---|---|
  | `:stop` | stops at once, where it is |
  | `:hold` | goes to the place that it was last given, and stands there |
  | `:continue` | goes on by itself: searches, and leads itself if it may |

  Without the option, followers stop, leaders and searchers continue; if it is given, it applies
  to all. A robot that never met another cannot lose the link.
  """
  alias Swarm.Agreement.Election
  alias Missions.Landmark.Reference
  alias Missions.Landmark

  # A heartbeat lists the robots that were heard in the last second.
  @heard_ms 1_000
  # A leader's lease, plus the time that a heartbeat may be under way.
  @vow_ms 1_800
  # How many anchors, ten a second, must say the same of the size of the fleet.
  @anchors 5
  # A robot that has only just been started has heard none yet.
  @gather_ms 2_000

  @doc """
  From the options of a mission (`Missions.Landmark.Options`): the size of the fleet of which a
  majority is required (0 if none is), and what to do when the link is lost.

      iex> Missions.Landmark.Policy.of([policy: :majority, of: 4])
      {4, nil}
  """
  @spec of(keyword()) :: {of :: 0..1_000, lost_link :: :stop | :hold | :continue | nil}
  def of(options) do
    of = if options[:policy] == :majority, do: Keyword.fetch!(options, :of), else: 0
    {of, options[:lost_link]}
  end

  @doc "Notes once a tick whether this robot has company."
  @spec update(Landmark.State.t()) :: Landmark.State.t()
  def update(%{phase: :idle} = mission),
    do: %{mission | met?: false, promise: nil, gather_ms: mission.now_ms + @gather_ms}

  def update(mission) do
    mission = %{mission | met?: mission.met? or company?(mission)}
    if tells?(mission), do: promise(mission, mission.leader), else: mission
  end

  # Whether its heartbeats say that it follows this leader and hears it.
  defp tells?(%{leader: leader, me: me}) when leader in [nil, me], do: false

  defp tells?(%{leader: leader} = mission) do
    case mission.percept.peers do
      %{^leader => %{direct_ms: at_ms}} when at_ms != nil ->
        mission.now_ms - at_ms < @heard_ms

      _unheard ->
        false
    end
  end

  @doc "Notes that this leader, or `nil` for one that is not known, may count on this robot from now on."
  @spec promise(Landmark.State.t(), atom()) :: Landmark.State.t()
  def promise(mission, leader), do: %{mission | promise: {leader, mission.now_ms}}

  @doc "Notes how large the fleet is, of which a majority is needed, by an anchor of its leader."
  @spec told(Landmark.State.t(), Reference.t()) :: Landmark.State.t()
  def told(%{of: of} = mission, %Reference{of: less}) when less <= of,
    do: %{mission | of_told: nil}

  def told(mission, %Reference{leader: leader, epoch: epoch, of: more}) do
    case mission.of_told do
      {{^leader, ^epoch, ^more}, @anchors} -> %{mission | of: more, of_told: nil}
      {{^leader, ^epoch, ^more} = said, n} -> %{mission | of_told: {said, n + 1}}
      _another -> %{mission | of_told: {{leader, epoch, more}, 2}}
    end
  end

  @doc "Whether a leader that is not among these may still count on this robot."
  @spec bound?(Landmark.State.t(), [atom()]) :: boolean()
  def bound?(%{of: of, promise: promise}, _view) when of == 0 or promise == nil, do: false

  def bound?(%{promise: {leader, at_ms}} = mission, view),
    do: leader not in view and mission.now_ms - at_ms < @vow_ms

  @doc "Whether this robot was with others, and no longer hears any."
  @spec lost?(Landmark.State.t()) :: boolean()
  def lost?(mission), do: mission.met? and not company?(mission)

  @doc "Whether this robot hears any other."
  @spec company?(Landmark.State.t()) :: boolean()
  def company?(mission),
    do: Landmark.State.beats(mission) != %{}

  @doc "What this robot does when the link is lost, depending on its last role."
  @spec lost_link(Landmark.State.t()) :: :stop | :hold | :continue
  def lost_link(%{lost_link: nil, role: :follower}), do: :stop
  def lost_link(%{lost_link: nil}), do: :continue
  def lost_link(%{lost_link: link}), do: link

  @doc "Whether this many robots may have a leader."
  @spec enough?(Landmark.State.t(), non_neg_integer()) :: boolean()
  def enough?(mission, robots), do: Election.enough?(robots, mission.of)

  @doc "Whether this robot may open a round among this many robots."
  @spec may_open?(Landmark.State.t(), non_neg_integer()) :: boolean()
  def may_open?(mission, robots),
    do: enough?(mission, robots) and not (lost?(mission) and lost_link(mission) != :continue)

  @doc """
  Whether there are too few robots to have a leader; right after the start they are given time.
  """
  @spec short?(Landmark.State.t(), non_neg_integer()) :: boolean()
  def short?(mission, robots),
    do: not enough?(mission, robots) and mission.now_ms >= mission.gather_ms
end
