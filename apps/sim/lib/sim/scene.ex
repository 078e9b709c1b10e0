defmodule Sim.Scene do
  @moduledoc """
  Shows a whole fleet from outside in a snapshot, which viewers get ten times a second.

  The lockstep run and the live fleet both produce it, so the terminal, the page and the picture
  can draw either. Poses are the true ones, in metres and radians, in the frame `map`; `at_ms`
  counts simulated milliseconds from the start. `mission` is the name of the mission that most robots run, `formation` the shape in force, `nil` if that is not known;
  `layer` is what it draws over the map (`Robot.Mission`).
  """
  alias Hal.Pose

  @enforce_keys [:at_ms, :map, :robots]
  defstruct @enforce_keys ++
              [
                landmark: nil,
                objects: [],
                mission: nil,
                layer: [],
                leader: nil,
                epoch: 0,
                formation: {:column, 1.0},
                error: nil,
                formed?: false,
                estop: nil,
                stages: []
              ]

  @typedoc """
  One robot. `radius` is that of the circle round it, `corners` are those of a box, in its own frame (`Hal.Profile.corners/1`).
  `slot` is its place in the formation relative to the leader's true pose; `size_ppm`
  is the share of its picture that the landmark fills, in parts per million, and `nil` while it
  does not see it. By its own estimate the robot is within `uncertainty` metres of where it
  believes to be (`believed`, in the frame of its estimate) in 95 of 100 cases, `nil` if it does not know. `blocked_by` and
  `says` are the lines of its mission for people, `nil` if there is nothing to say. `crashed`, `fault` (lines), `offline` (devices), `lost`
  and `arming`, where the wheels may not turn, say what else keeps it from its work.
  """
  @type robot :: %{
          required(:id) => atom(),
          required(:pose) => Pose.t(),
          required(:radius) => float(),
          optional(:corners) => [Pose.point()],
          required(:alive) => boolean(),
          required(:state) => atom(),
          required(:slot) => Pose.point() | nil,
          required(:leader?) => boolean(),
          required(:uncertainty) => float() | nil,
          required(:size_ppm) => non_neg_integer() | nil,
          optional(:believed) => Pose.t() | nil,
          optional(:blocked_by) => String.t() | nil,
          optional(:says) => String.t() | nil,
          optional(:crashed) => String.t() | nil,
          optional(:fault) => String.t() | nil,
          optional(:offline) => [atom() | String.t()],
          optional(:lost) => boolean(),
          optional(:arming) => {:disarmed | :line_lost, why :: String.t() | nil} | nil,
          optional(atom()) => term()
        }

  @typedoc "A ball, with its radius in metres, or a box, with its corners in the frame of the map; `pose` is that of its middle."
  @type thing :: %{
          required(:id) => String.t(),
          required(:kind) => :ball | :box,
          required(:pose) => Pose.t(),
          required(:radius) => float() | nil,
          required(:corners) => [Pose.point()],
          optional(atom()) => term()
        }

  @typedoc """
  Something that happened to the fleet; the newest is the last of the list. A fleet without an end keeps only the newest, and
  numbers them (`n`).
  """
  @type stage :: %{
          required(:stage) => atom(),
          required(:at_s) => number(),
          optional(:robot) => atom() | nil,
          optional(:epoch) => integer() | nil,
          optional(:size_ppm) => integer() | nil,
          optional(:as) => atom(),
          optional(:asked) => String.t(),
          optional(:followers) => non_neg_integer(),
          optional(:n) => pos_integer()
        }

  @type t :: %__MODULE__{
          at_ms: non_neg_integer(),
          map: term(),
          robots: [robot()],
          landmark: Pose.point() | nil,
          objects: [thing()],
          mission: String.t() | nil,
          layer: [tuple()],
          leader: atom() | nil,
          epoch: non_neg_integer(),
          formation: {atom(), float()} | nil,
          error: {mean :: float(), max :: float()} | nil,
          formed?: boolean(),
          estop: estop() | nil,
          stages: [stage()]
        }

  @typedoc """
  An emergency stop that holds robots of the fleet: which ones, of how many, since when (`at_ms`), and the names of
  those that called it, as far as the robots know.
  """
  @type estop :: %{
          held: [atom(), ...],
          of: non_neg_integer(),
          since_ms: integer(),
          by: [String.t()]
        }

  @doc """
  The emergency stop after one look at the fleet, of which these robots are held; `before` is that of the look before.

      iex> Sim.Scene.estop(nil, [], 2, 100)
      nil
      iex> stop = Sim.Scene.estop(nil, [mag1: ["base"]], 2, 100)
      iex> Sim.Scene.estop(stop, [mag1: ["base"], mag2: []], 2, 200)
      %{held: [:mag1, :mag2], of: 2, since_ms: 100, by: ["base"]}
  """
  @spec estop(estop() | nil, [{atom(), callers :: [String.t()]}], non_neg_integer(), integer()) ::
          estop() | nil
  def estop(_before, [], _of, _at_ms), do: nil

  def estop(before, held, of, at_ms) do
    {robots, callers} = Enum.unzip(held)
    since_ms = if before, do: before.since_ms, else: at_ms
    %{held: robots, of: of, since_ms: since_ms, by: callers |> Enum.concat() |> Enum.uniq()}
  end

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

  @doc """
  How many stages there have been, with those that are no longer kept.

      iex> {Sim.Scene.told([%{stage: :formed, at_s: 1}]), Sim.Scene.told([%{stage: :formed, at_s: 1, n: 7}])}
      {1, 7}
  """
  @spec told([stage()]) :: non_neg_integer()
  def told(stages) do
    case List.last(stages) do
      %{n: n} -> n
      _none_or_all -> length(stages)
    end
  end

  @doc """
  The stages after so many, as far as they are kept.

      iex> stages = for n <- 5..7, do: %{stage: :formed, at_s: n, n: n}
      iex> for told <- [2, 6, 7], do: stages |> Sim.Scene.news(told) |> Enum.map(& &1.n)
      [[5, 6, 7], [7], []]
  """
  @spec news([stage()], told :: non_neg_integer()) :: [stage()]
  def news(stages, told), do: Enum.take(stages, -max(told(stages) - told, 0))

  @typedoc "The points at which something was, the newest first."
  @type way :: [Pose.point()]

  @doc "Each robot's way, with where it is now (`way/3`)."
  @spec ways(%{atom() => way()}, t(), apart_m :: float()) :: %{atom() => way()}
  def ways(ways, %__MODULE__{robots: robots}, apart_m) do
    for %{id: id, pose: pose} <- robots, reduce: ways do
      ways -> Map.put(ways, id, way(Map.get(ways, id, []), Pose.point(pose), apart_m))
    end
  end

  @doc """
  A way with a place, where that is so far from its last point; `nil` is no place.

      iex> [] |> Sim.Scene.way({0.0, 0.0}, 0.5) |> Sim.Scene.way({0.1, 0.0}, 0.5) |> Sim.Scene.way({0.6, 0.0}, 0.5)
      [{0.6, 0.0}, {0.0, 0.0}]
  """
  @spec way(way(), Pose.point() | nil, apart_m :: float()) :: way()
  def way(way, nil, _apart_m), do: way
  def way([], place, _apart_m), do: [place]

  def way([newest | _] = way, place, apart_m),
    do: if(Pose.distance(newest, place) < apart_m, do: way, else: [place | way])
end
