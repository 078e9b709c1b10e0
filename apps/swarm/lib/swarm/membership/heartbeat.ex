defmodule Swarm.Membership.Heartbeat do
  @moduledoc """
  What a robot tells all others five times a second: its pose, its state, the robots that it
  hears, and the one that it follows. Whole numbers only: mm, mrad, mm/s, mrad/s, millionths of a
  picture.

  `estop` has the tags of the emergency stops that hold it (`Swarm.EStop.State`). `sight` is its newest view of the landmark:
  relative size and estimated distance, `nil` if it does not see it. Only the leader's heartbeats
  contain `anchor`. `in_place` says that a follower is in its slot, `unsure` that it believes so
  but is not sure enough. `sd` is the uncertainty of its place in its leader's frame, `nil`
  outside it. `boot` is the number of its life, which grows with every start.
  """
  alias Swarm.Membership.NameSet
  alias Swarm.Wire
  alias Swarm.Wire.StopTags

  @enforce_keys [:boot, :sequence, :pose, :twist]
  defstruct @enforce_keys ++
              [
                radius: 200,
                sd: nil,
                phase: :idle,
                epoch: 0,
                leader: nil,
                heard: <<>>,
                sight: nil,
                standing: false,
                in_place: false,
                unsure: false,
                blocked: false,
                formed: false,
                estop: [],
                anchor: nil
              ]

  @typedoc "Standard deviations of a place in mm, along the worst direction and across it, and that direction in mrad."
  @type spread :: {worst :: non_neg_integer(), least :: non_neg_integer(), direction :: integer()}

  @type t :: %__MODULE__{
          boot: integer(),
          sequence: non_neg_integer(),
          pose: {x :: integer(), y :: integer(), heading :: integer()},
          twist: {linear :: integer(), turn :: integer()},
          radius: pos_integer(),
          sd: spread() | nil,
          phase: atom(),
          epoch: non_neg_integer(),
          leader: atom() | nil,
          heard: NameSet.t(),
          sight: %{size_ppm: pos_integer(), distance: pos_integer() | nil} | nil,
          standing: boolean(),
          in_place: boolean(),
          unsure: boolean(),
          blocked: boolean(),
          formed: boolean(),
          estop: [StopTags.tag()],
          anchor: Swarm.Formation.Reference.t() | nil
        }

  # Five a second. Ticks come every 100 ms, some of them a little early.
  @period_ms 200
  @early_ms 50

  @doc """
  Whether a heartbeat is due if the last was sent at `last_ms`; `nil` before the first.

      iex> for at_ms <- [100, 199, 300], do: Swarm.Membership.Heartbeat.due?(0, at_ms)
      [false, true, true]
  """
  @spec due?(last_ms :: integer() | nil, at_ms :: integer()) :: boolean()
  def due?(nil, _at_ms), do: true
  def due?(last_ms, at_ms), do: at_ms - last_ms >= @period_ms - @early_ms

  # An anchor is good for as long, so nobody follows a leader that has decided nothing since.
  @claim_ms 1_000

  @doc """
  What a robot may claim that made this claim so long ago. A leadership lapses after a second:
  the robot may have been frozen or hung, and others may have elected another leader. What it says
  before its mission has looked at the clock must not contradict them.

      iex> claim = %{phase: :lead, leader: :mag1, epoch: 3, formed: true, anchor: nil}
      iex> Swarm.Membership.Heartbeat.timely(claim, 100) == claim
      true
      iex> Swarm.Membership.Heartbeat.timely(claim, 1_900)
      %{phase: :agree, leader: nil, epoch: 3, formed: false, anchor: nil}
      iex> Swarm.Membership.Heartbeat.timely(%{phase: :follow, leader: :mag2}, 1_900)
      %{phase: :follow, leader: :mag2}
  """
  @spec timely(claim :: map(), age_ms :: integer()) :: map()
  def timely(%{phase: :lead} = claim, age_ms) when age_ms > @claim_ms,
    do: Map.merge(claim, %{phase: :agree, leader: nil, formed: false, anchor: nil})

  def timely(claim, _age_ms), do: claim

  @typedoc "What a heartbeat says about the body; `Robot.Percept` is one."
  @type body :: %{
          :pose => Hal.Pose.t(),
          :odometry => Hal.Odometry.t() | nil,
          :profile => Hal.Profile.t(),
          optional(atom()) => term()
        }

  @doc """
  The heartbeat of a robot: how its body moves, what its mission claims (`:idle`: it has none, and
  stands), and the robots that it hears. A body without odometry counts as standing.
  """
  @spec new(
          {integer(), non_neg_integer()},
          body(),
          claim :: map() | :idle,
          [atom()],
          %{:held => [StopTags.tag()], optional(atom()) => term()}
        ) ::
          t()
  def new({boot, sequence}, %{pose: pose} = body, claim, heard, stop) do
    twist = if body.odometry, do: body.odometry.twist, else: Hal.Twist.zero()
    claim = if claim == :idle, do: %{standing: true}, else: claim

    beat = %__MODULE__{
      boot: boot,
      sequence: sequence,
      pose: {round(pose.x * 1000), round(pose.y * 1000), round(pose.heading * 1000)},
      twist: {round(twist.linear * 1000), round(twist.turn * 1000)},
      radius: round(body.profile.radius * 1000),
      heard: NameSet.new(heard),
      estop: stop.held
    }

    # These fields are for people, who ask the robot itself. So are any others that a user's
    # mission claims.
    struct(beat, Map.drop(claim, [:blocked_by, :uncertainty]))
  end

  @doc """
  Whether a term from outside is a heartbeat with sane numbers.

      iex> Swarm.Membership.Heartbeat.valid?(%Swarm.Membership.Heartbeat{boot: 1, sequence: 1, pose: {0, 0, 0}, twist: {0, 0}})
      true
      iex> Swarm.Membership.Heartbeat.valid?(%Swarm.Membership.Heartbeat{boot: 1, sequence: 1, pose: {0, 1.5, 0}, twist: {0, 0}})
      false
  """
  @spec valid?(term()) :: boolean()
  def valid?(%__MODULE__{twist: {linear, turn}} = beat) do
    Wire.whole?(beat, __MODULE__) and Wire.pose?(beat.pose) and
      Wire.number?(linear) and
      Wire.number?(turn) and Wire.boot?(beat.boot) and
      Wire.counter?(beat.sequence) and beat.radius in 50..2000 and
      sd?(beat.sd) and Wire.name?(beat.phase) and
      Wire.counter?(beat.epoch) and (beat.leader == nil or Wire.name?(beat.leader)) and
      NameSet.valid?(beat.heard) and sight?(beat.sight) and
      Enum.all?(
        [beat.standing, beat.in_place, beat.unsure, beat.blocked, beat.formed],
        &is_boolean/1
      ) and StopTags.tags?(beat.estop) and
      (beat.anchor == nil or Swarm.Formation.Reference.valid?(beat.anchor))
  end

  def valid?(_term), do: false

  defp sd?(nil), do: true

  defp sd?({worst, least, direction}),
    do: worst in 0..100_000 and least in 0..100_000 and direction in -4_000..4_000

  defp sd?(_other), do: false

  defp sight?(nil), do: true

  defp sight?(%{size_ppm: size, distance: distance} = sight),
    do:
      map_size(sight) == 2 and size in 0..1_000_000 and
        (distance == nil or distance in 0..1_000_000)

  defp sight?(_other), do: false
end
