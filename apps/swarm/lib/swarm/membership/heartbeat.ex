defmodule Swarm.Membership.Heartbeat do
  @moduledoc """
  Describes what a robot tells all others five times a second: its pose and speed, the robots that it hears, the one that it follows,
  what it does, and what its mission claims. Whole numbers only: mm, mrad, mm/s, mrad/s.

  `boot` is the number of its life, which grows with every start. `estop` has the tags of the emergency stops that hold it
  (`Swarm.EStop.State`). `claim` is its mission's own (`Robot.Mission.Claim`), `nil` of a robot without one.
  """
  alias Robot.Mission.Claim
  alias Swarm.Membership.NameSet
  alias Swarm.Wire
  alias Swarm.Wire.StopTags

  @enforce_keys [:boot, :sequence, :pose, :twist]
  defstruct @enforce_keys ++
              [
                radius: 200,
                phase: :idle,
                leader: nil,
                heard: <<>>,
                standing: false,
                estop: [],
                claim: nil
              ]

  @type t :: %__MODULE__{
          boot: integer(),
          sequence: non_neg_integer(),
          pose: {x :: integer(), y :: integer(), heading :: integer()},
          twist: {linear :: integer(), turn :: integer()},
          radius: pos_integer(),
          phase: atom(),
          leader: atom() | nil,
          heard: NameSet.t(),
          standing: boolean(),
          estop: [StopTags.tag()],
          claim: Claim.t() | nil
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
          {mission :: module(), claim :: map()} | :idle,
          [atom()],
          %{:held => [StopTags.tag()], optional(atom()) => term()}
        ) :: t()
  def new({boot, sequence}, %{pose: pose} = body, claim, heard, stop) do
    twist = if body.odometry, do: body.odometry.twist, else: Hal.Twist.zero()

    claim(
      %__MODULE__{
        boot: boot,
        sequence: sequence,
        pose: {round(pose.x * 1000), round(pose.y * 1000), round(pose.heading * 1000)},
        twist: {round(twist.linear * 1000), round(twist.turn * 1000)},
        radius: round(body.profile.radius * 1000),
        heard: NameSet.new(heard),
        estop: stop.held
      },
      claim
    )
  end

  defp claim(beat, :idle), do: %{beat | standing: true}

  defp claim(beat, {mission, claim}) do
    %{
      beat
      | phase: Map.get(claim, :phase, :idle),
        leader: claim[:leader],
        standing: Map.get(claim, :standing, false),
        claim: Claim.new(mission, claim)
    }
  end

  @doc """
  A term from outside as a heartbeat with sane numbers, and with the claim that is heard here (`Robot.Mission.Claim.check/1`).

      iex> beat = %Swarm.Membership.Heartbeat{boot: 1, sequence: 1, pose: {0, 0, 0}, twist: {0, 0}}
      iex> Swarm.Membership.Heartbeat.check(beat) == {:ok, beat}
      true
      iex> Swarm.Membership.Heartbeat.check(%{beat | pose: {0, 1.5, 0}})
      :error
  """
  @spec check(term()) :: {:ok, t()} | :error
  def check(%__MODULE__{twist: {linear, turn}} = beat) do
    with true <-
           Wire.whole?(beat, __MODULE__) and Wire.pose?(beat.pose) and
             Wire.number?(linear) and Wire.number?(turn) and Wire.boot?(beat.boot) and
             Wire.counter?(beat.sequence) and beat.radius in 50..2000 and
             Wire.name?(beat.phase) and (beat.leader == nil or Wire.name?(beat.leader)) and
             NameSet.valid?(beat.heard) and is_boolean(beat.standing) and
             StopTags.tags?(beat.estop),
         {:ok, claim} <- Claim.check(beat.claim) do
      {:ok, if(claim == nil, do: %{beat | claim: nil}, else: beat)}
    else
      _wrong -> :error
    end
  end

  def check(_term), do: :error
end
