defmodule Missions.Landmark.State do
  @moduledoc """
  Holds the state of the landmark mission in one robot, and the questions that all parts of the mission ask of it. Pure.
  The parts' own states are under `leadership`, `follower`, `round`, `sight`.
  """
  alias Hal.{Pose, Twist}
  alias Missions.Landmark
  alias Missions.Landmark.{Company, EpochFilter, LandmarkTrack}

  @colour "YellowLandmark"
  @sight_ms 700

  @enforce_keys [:me, :formation, :assign, :leader_change?]
  defstruct @enforce_keys ++
              [
                asked_no: 0,
                signs: nil,
                colour: @colour,
                percept: nil,
                company: nil,
                now_ms: 0,
                phase: :idle,
                since_ms: 0,
                started?: false,
                scan: nil,
                sight: nil,
                pictured_ms: nil,
                tries: 0,
                round: nil,
                verdict: nil,
                rescan?: false,
                lookout: nil,
                order: [],
                epoch: 0,
                leader: nil,
                size_ppm: nil,
                anchor: nil,
                anchor_ms: nil,
                trail: [],
                leadership: nil,
                follower: nil,
                challenge: nil,
                of: 0,
                of_told: nil,
                lost_link: nil,
                role: :searcher,
                met?: false,
                gather_ms: 0,
                promise: nil,
                place: nil,
                led: 0,
                rival_ms: nil,
                higher_ms: nil,
                refused: %EpochFilter{}
              ]

  @typedoc """
  `company` is that of `company/1`, with what it was made of. `asked_no` counts the shapes that people, or `signs`, asked for, so that an older anchor does not undo the
  newest. `since_ms` is when the phase began, `scan` how the last turn ended, `rescan?` whether
  the next round needs a new one, `tries` how many searches found nothing, `verdict` the result of
  the last round until a phase has acted on it, `order` the followers by slot. `epoch` and
  `leader` are those that the robot belongs to, `size_ppm` is the size that elected the leader,
  `anchor_ms` when the anchor came.

  `of` is the size of the fleet of which a majority is needed, 0 for none; `of_told` a greater one
  that the leader says, and the number of its next anchor that says it. `role` is the robot's last
  role, `met?` whether it has been with others, `promise` which leader may count on it, and when
  it last could, `place` where it was last told to stand. `led` is how many robots it leads, or
  led when the round began; it has heard another leader since `rival_ms`, and a later epoch since
  `higher_ms`.
  """
  @type t :: %__MODULE__{
          me: atom(),
          formation: Swarm.Formation.t(),
          asked_no: non_neg_integer(),
          signs: Missions.Landmark.Signs.t() | nil,
          assign: Swarm.Formation.Assignment.method(),
          leader_change?: boolean(),
          colour: String.t(),
          percept: Robot.Percept.t() | nil,
          company: {peers :: map(), now_ms :: integer(), Company.t()} | nil,
          now_ms: integer(),
          phase: Missions.Landmark.Transitions.phase(),
          since_ms: integer(),
          started?: boolean(),
          scan: :found | :nothing | nil,
          sight: LandmarkTrack.t() | nil,
          pictured_ms: integer() | nil,
          tries: non_neg_integer(),
          round: Swarm.Agreement.Round.t() | nil,
          verdict: {:leader, atom()} | :nobody | nil,
          rescan?: boolean(),
          lookout: Landmark.Lookout.Legs.t() | nil,
          order: [atom()],
          epoch: non_neg_integer(),
          leader: atom() | nil,
          size_ppm: non_neg_integer() | nil,
          anchor: Missions.Landmark.Reference.t() | nil,
          anchor_ms: integer() | nil,
          trail: Swarm.Formation.Trail.t(),
          leadership: Missions.Landmark.Leader.t() | nil,
          follower: Missions.Landmark.Follower.t() | nil,
          challenge: :open | {:nearer | :gone | :blind, since_ms :: integer()} | nil,
          of: non_neg_integer(),
          of_told:
            {{leader :: atom(), epoch :: pos_integer(), of :: pos_integer()},
             next :: pos_integer()}
            | nil,
          lost_link: :stop | :hold | :continue | nil,
          role: :searcher | :leader | :follower,
          met?: boolean(),
          gather_ms: integer(),
          promise: {leader :: atom(), at_ms :: integer()} | nil,
          place: Pose.t() | nil,
          led: non_neg_integer(),
          rival_ms: integer() | nil,
          higher_ms: integer() | nil,
          refused: EpochFilter.t()
        }

  @doc "The default colour of the landmark."
  @spec colour() :: String.t()
  def colour, do: @colour

  @doc "Keeps what `company/1` returns, which is asked for many times a tick."
  @spec note_company(t()) :: t()
  def note_company(%{percept: %{peers: peers}, now_ms: now} = mission),
    do: %{mission | company: {peers, now, company(mission)}}

  @doc "The others that are not gone."
  @spec company(t()) :: Company.t()
  def company(%{company: {peers, now, company}, percept: %{peers: peers}, now_ms: now}),
    do: company

  def company(%{me: me, percept: %{peers: peers}, now_ms: now}), do: Company.of(me, peers, now)

  @doc "The newest heartbeats of all others that are not gone, by name."
  @spec beats(t()) :: %{atom() => Swarm.Membership.Heartbeat.t()}
  def beats(mission), do: company(mission).beats

  @doc "Whether the landmark is in this robot's picture."
  @spec sees?(t()) :: boolean()
  def sees?(mission), do: LandmarkTrack.fresh?(mission.sight, mission.now_ms, @sight_ms)

  @doc "Whether a robot moves slower than `limit` m/s according to its wheels."
  @spec slow?(Robot.Percept.t(), float()) :: boolean()
  def slow?(%{odometry: %{twist: %Twist{linear: linear}}}, limit), do: abs(linear) < limit
  def slow?(_percept, _limit), do: true

  @doc "A pose in whole millimetres and milliradians, as robots report it."
  @spec millimetres(Pose.t()) :: {integer(), integer(), integer()}
  def millimetres(%Pose{x: x, y: y, heading: heading}),
    do: {round(x * 1000), round(y * 1000), round(heading * 1000)}
end
