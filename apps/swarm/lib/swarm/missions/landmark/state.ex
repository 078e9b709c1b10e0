defmodule Swarm.Missions.Landmark.State do
  @moduledoc """
  What one robot keeps of the landmark mission between two events, and what all parts of the
  mission ask of it. Pure. The parts' own states are under `lead`, `attend`, `round`, `sight`.
  """
  alias Hal.{Pose, Twist}
  alias Swarm.Missions.Landmark.Sight

  @colour "YellowLandmark"
  @sight_ms 700

  @enforce_keys [:me, :formation, :assign, :leader_change?]
  defstruct @enforce_keys ++
              [
                colour: @colour,
                percept: nil,
                now_ms: 0,
                phase: :idle,
                since_ms: 0,
                started?: false,
                scan: nil,
                sight: nil,
                tries: 0,
                round: nil,
                verdict: nil,
                rescan?: false,
                order: [],
                epoch: 0,
                leader: nil,
                founded: nil,
                size_ppm: nil,
                anchor: nil,
                anchor_ms: nil,
                trail: [],
                lead: nil,
                attend: nil,
                challenge: nil
              ]

  @type t :: %__MODULE__{}

  @doc "The colour of the landmark unless told otherwise."
  @spec colour() :: String.t()
  def colour, do: @colour

  @doc "Whether the landmark is in this robot's picture."
  @spec sees?(t()) :: boolean()
  def sees?(mission), do: Sight.fresh?(mission.sight, mission.now_ms, @sight_ms)

  @doc "Whether a robot moves slower than `limit` m/s, as far as its wheels say."
  @spec slow?(Robot.Percept.t(), float()) :: boolean()
  def slow?(%{odometry: %{twist: %Twist{linear: linear}}}, limit), do: abs(linear) < limit
  def slow?(_percept, _limit), do: true

  @doc "A pose in whole millimetres and milliradians, as robots tell it."
  @spec millimetres(Pose.t()) :: {integer(), integer(), integer()}
  def millimetres(%Pose{x: x, y: y, heading: heading}),
    do: {round(x * 1000), round(y * 1000), round(heading * 1000)}
end
