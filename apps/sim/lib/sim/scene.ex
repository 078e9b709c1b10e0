defmodule Sim.Scene do
  @moduledoc """
  Shows a whole fleet from outside in a snapshot, which viewers get ten times a second.

  The lockstep run and the live fleet both produce it, so the terminal, the page and the picture
  can draw either. Poses are the true ones, in metres and radians, in the frame `map`; `at_ms`
  counts simulated milliseconds from the start.
  """
  alias Hal.Pose

  @enforce_keys [:at_ms, :map, :robots]
  defstruct @enforce_keys ++
              [
                landmark: nil,
                leader: nil,
                epoch: 0,
                formation: {:column, 1.0},
                error: nil,
                formed?: false,
                stages: []
              ]

  @typedoc """
  One robot. `slot` is its place in the formation relative to the leader's true pose; `size_ppm`
  is the share of its picture that the landmark fills, in parts per million, and `nil` while it
  does not see it. By its own estimate the robot is within `uncertainty` metres of where it
  believes to be in 95 of 100 cases, `nil` if it does not know.
  """
  @type robot :: %{
          id: atom(),
          pose: Pose.t(),
          radius: float(),
          alive: boolean(),
          state: atom(),
          slot: Pose.point() | nil,
          leader?: boolean(),
          uncertainty: float() | nil,
          size_ppm: non_neg_integer() | nil
        }

  @typedoc "Something that happened to the fleet; the newest is the last of the list."
  @type stage :: %{
          required(:stage) => atom(),
          required(:at_s) => number(),
          optional(:robot) => atom() | nil,
          optional(:epoch) => integer() | nil,
          optional(:size_ppm) => integer() | nil,
          optional(:as) => atom(),
          optional(:asked) => String.t(),
          optional(:followers) => non_neg_integer()
        }

  @type t :: %__MODULE__{
          at_ms: non_neg_integer(),
          map: term(),
          robots: [robot()],
          landmark: Pose.point() | nil,
          leader: atom() | nil,
          epoch: non_neg_integer(),
          formation: {atom(), float()},
          error: {mean :: float(), max :: float()} | nil,
          formed?: boolean(),
          stages: [stage()]
        }

  @doc """
  How far a robot is from its slot, in metres; `nil` for a robot without a slot.

      iex> Sim.Scene.slot_error(%{pose: Hal.Pose.new(1, 0), slot: {1.0, 2.0}})
      2.0
      iex> Sim.Scene.slot_error(%{pose: Hal.Pose.new(1, 0), slot: nil})
      nil
  """
  @spec slot_error(%{:pose => Pose.t(), :slot => Pose.point() | nil, optional(atom()) => term()}) ::
          float() | nil
  def slot_error(%{slot: nil}), do: nil
  def slot_error(%{pose: pose, slot: slot}), do: Pose.distance(pose, slot)

  @doc """
  The last stage, or `nil` before the first.

      iex> Sim.Scene.stage(%Sim.Scene{at_ms: 0, map: nil, robots: []})
      nil
  """
  @spec stage(t()) :: stage() | nil
  def stage(%__MODULE__{stages: stages}), do: List.last(stages)
end
