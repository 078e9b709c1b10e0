defmodule Swarm.Status do
  @moduledoc """
  Describes a robot's status, for people. In `iex` it prints as one line:

      #mag1 follow (1.20, -0.35, 90 deg) ±0.12 m, 0.31 m/s by follow, view 7, hears 4 but not min2, age 40 ms

  The number after the pose is its uncertainty: in 95 of 100 cases the robot is no farther from it
  (`uncertainty`, metres; `Robot.Percept`). A follower's pose is in its leader's frame, any other
  robot's in that of its start pose (`frame`; `Swarm.Status.Frame`). `epoch` counts the
  elections that its mission knows of.

  `mission` is the name of its mission, and `formation` the shape that a leader leads others in; a row has neither.

  `weights` are all behaviours that wished for something, with the weights by which they were compared, the chosen one
  (`by`) first; `way` are the corners of the way that it takes round what stands about, the goal last, in the frame of its
  pose. A row has neither.

  A robot that the emergency stop holds is `E-STOP`, with the nodes that called it as far as it knows (`estop_by`).

  If the wheels may not turn, it says `DISARMED`, with what is missing, or `LINE LOST` until a
  person acknowledges (`Hal.Device.Arming`; `arming` and `why`). For a device that is offline it
  says why: `drive offline (/dev/ttyR0: no such device)` (`offline`: texts by device). A robot
  that is slow because it has no sonar is `BLIND`, and one that is because another may be near, which it cannot tell, is
  `CAUTIOUS` (`Robot.Behaviour.Avoid.Caution`). A robot that stands without being told to says
  `FAULT`, and why (`fault`). One whose e-stop file does not say what the stop does says `E-STOP NOT ON ITS DISK`, or
  `RESET NOT ON ITS DISK`, with the file and why (`estop_file`); it is tried again until it does.

  If a robot's gate, behaviour or mission hangs, it says so, also for a minute after the restart
  that follows (`Robot.Safety.LivenessMonitor`; `hung`: `:silent` or `:hung`, in what, and how
  long ago, ms).

  One whose mission or behaviour crashed stands idle, and says `CRASHED`, what failed and where, until its next order
  (`crashed`; `Robot.Control.Crash`).

  A robot that does not get to its place is `BLOCKED by …`, as its mission says (`blocked_by`); what that says in words of
  its own (`says`) stands there as it is.

  A robot whose mission was replaced says which it got, its sender, and why it went back (`replaced`; `Swarm.replace/2`).

  `speed` (m/s) is what its wheels report, not what they are told: a robot that was stopped shows how
  fast it still rolls. It is as old as `age_ms` says, and `nil`, `speed unknown`, before the first report.

  `age_ms` is the age of the newest report of its wheels; `rejected` counts malformed messages by kind. `hears`
  are the robots that it hears itself, `view` those that it considers present (including itself),
  with the view's number, which grows with each robot that comes or goes
  (`Swarm.Membership.Peers`). The line names the robots that it knows only by way of others as not
  heard. `Swarm.matrix/0` shows the same for all robots as a table.

  `body` is its shape, which a row does not have.

  After the age stands where its camera looks (`head`), and what that shows of the landmark (`sees`; `Swarm.Status.Sight`), of
  robots that have a pan-tilt unit and a camera: `looks at 12, 0 deg (zoom 49 deg), sees YellowLandmark at -12 deg, 2.31 m`.

  `meters` are its counts since its board began (`Robot.Meters`); the line does not have them.

  A robot whose machine has no network says `NO NETWORK`, and why (`network`; `Mesh.fault/0`).

  The status of a robot that does not answer comes from its row on the blackboard (`from: :row`),
  with that age: `…, age 1240 ms by its row`.
  """
  alias Hal.Device.Explanation
  alias Hal.{Odometry, Pose, Twist}
  alias Robot.Board
  alias Robot.Mission.Manual
  alias Robot.Safety.LivenessMonitor
  alias Swarm.{EStop, MissionRegistry}
  alias Swarm.Message.Receiver
  alias Swarm.Membership.Peers
  alias Swarm.Status.{Frame, Sight}

  @recently_ms 60_000
  @ahead_m 1.0

  # One line a field, in the order in which the status line has them: its default, and how a row of the blackboard has it
  # (`Swarm.Status.Row`), `nil` for not at all. `read/2` takes it from the robot's board, `Swarm.Status.Words.of/2` puts it in words.
  @fields [
    from: {:robot, nil},
    node: {nil, :name},
    body: {nil, nil},
    state: {:idle, :name},
    mission: {nil, nil},
    formation: {nil, nil},
    by: {nil, :word},
    weights: {[], nil},
    way: {[], nil},
    pose: {nil, :pose},
    uncertainty: {nil, {:maybe, :metres}},
    frame: {nil, {:maybe, :frame}},
    speed: {0.0, :thousandths},
    power: {nil, :number},
    epoch: {nil, {:maybe, :count}},
    peers: {%{}, nil},
    estop: {false, :boolean},
    estop_by: {[], nil},
    estop_file: {nil, {:maybe, {:text, 80}}},
    arming: {nil, {:maybe, :arming}},
    why: {nil, nil},
    fault: {nil, {:maybe, {:text, 500}}},
    limits: {[], :words},
    hung: {nil, {:maybe, :hung}},
    crashed: {nil, {:maybe, {:text, 240}}},
    blocked_by: {nil, {:maybe, {:text, 80}}},
    says: {nil, {:maybe, {:text, 80}}},
    replaced: {nil, nil},
    leader: {nil, :word},
    view: {nil, :view},
    hears: {[], nil},
    network: {nil, nil},
    meters: {nil, nil},
    rejected: {%{}, :sum},
    age_ms: {nil, :age},
    head: {nil, {:maybe, :head}},
    sees: {nil, {:maybe, :sight}},
    health: {%{}, :offline},
    offline: {%{}, nil}
  ]

  # What its comms knows, and not its board.
  @heard [:peers, :view, :hears, :rejected]

  @enforce_keys [:robot]
  defstruct @enforce_keys ++ for({name, {default, _sent}} <- @fields, do: {name, default})

  @typedoc "Its shape: the circle round it, and the corners of a box (`Hal.Profile.corners/1`), metres."
  @type body :: %{radius: float(), corners: [Pose.point()]}
  @type view :: {number :: non_neg_integer(), members :: [atom()]}
  @type t :: %__MODULE__{
          robot: atom(),
          from: :robot | :row,
          node: node() | String.t() | nil,
          body: body() | nil,
          state: atom() | String.t(),
          mission: String.t() | nil,
          formation: {kind :: atom(), spacing_m :: float()} | nil,
          by: atom() | String.t(),
          weights: [{by :: atom(), weight :: float()}],
          way: [Pose.point()],
          pose: Pose.t() | nil,
          uncertainty: float() | nil,
          frame: Frame.t() | :lost | nil,
          speed: float() | nil,
          limits: [atom() | String.t()],
          estop: boolean(),
          estop_by: [String.t()],
          estop_file: String.t() | nil,
          arming: Hal.Device.Arming.state() | nil,
          why: String.t() | nil,
          hung: {:silent | :hung, behaviour :: String.t(), ago_ms :: non_neg_integer()} | nil,
          crashed: String.t() | nil,
          leader: atom() | String.t() | nil,
          epoch: non_neg_integer() | nil,
          blocked_by: String.t() | nil,
          says: String.t() | nil,
          power: float() | nil,
          health: %{(atom() | String.t()) => :online | {:offline, term()}},
          offline: %{(atom() | String.t()) => String.t()},
          fault: String.t() | nil,
          replaced: String.t() | nil,
          peers: %{atom() => Peers.status()},
          hears: [atom()],
          view: view() | nil,
          rejected: %{atom() => pos_integer()},
          network: String.t() | nil,
          meters: Robot.Meters.counts() | nil,
          head: Sight.head(),
          sees: Sight.t(),
          age_ms: non_neg_integer() | nil
        }

  @doc "The fields that rows have, each with how it is sent (`Swarm.Status.Row`)."
  @spec sent() :: [{atom(), sent :: term()}]
  def sent, do: for({name, {_default, sent}} when sent != nil <- @fields, do: {name, sent})

  @doc "The status of a robot of this node, from its board and its receiver."
  @spec of(Robot.Config.t(), Board.t(), Receiver.t()) :: t()
  def of(config, board, receiver) do
    heard = %{receiver: receiver, now_ms: Robot.Config.now(config)}

    config
    |> of_board(Board.entries(board), board)
    |> struct!(for name <- @heard, do: {name, read(name, heard)})
  end

  @doc """
  The same by its board alone, from its entries with their ages, and the board itself, which may be one of a robot in lockstep:
  without what its comms alone knows, such as `hears`. The config may be what of it is needed.
  """
  @spec of_board(
          Robot.Config.t()
          | %{id: atom(), profile: Hal.Profile.t(), start: Pose.t(), drive: {nil, []}},
          %{term() => {term(), age_ms :: integer()}},
          Board.t() | Board.entries()
        ) :: t()
  def of_board(config, entries, board) do
    seen = %{config: config, board: board, entries: entries}
    fields = for {name, _about} <- @fields, name not in @heard, do: {name, read(name, seen)}
    struct!(__MODULE__, [{:robot, config.id} | fields])
  end

  defp read(:from, _seen), do: :robot
  defp read(:node, _seen), do: node()

  defp read(:body, %{config: %{profile: profile}}),
    do: %{radius: profile.radius, corners: Hal.Profile.corners(profile)}

  defp read(:network, _seen), do: Mesh.fault()
  defp read(:meters, %{board: %Board{meters: meters}}), do: Robot.Meters.read(meters)
  defp read(:meters, _in_lockstep), do: nil
  defp read(:state, %{entries: entries}), do: entries |> value(:mission) |> state()

  defp read(:mission, %{entries: entries}) do
    case value(entries, :mission) do
      %{state: {module, _phase}} when module != Manual -> MissionRegistry.name(module)
      _idle_or_by_hand -> nil
    end
  end

  # What stands ahead of a leader changes no shape, but the places in it.
  defp read(:formation, %{entries: entries}) do
    with %{state: {module, _phase}, claim: claim} <- value(entries, :mission),
         %Pose{} = pose <- value(entries, :pose),
         %{formation: formation} <- Robot.Mission.shape(module, claim, pose, @ahead_m),
         do: formation,
         else: (_leads_none -> nil)
  end

  defp read(:limits, %{entries: entries}),
    do: (entry(entries, :doing, :limits) || []) ++ (entry(entries, :driving, :limits) || [])

  defp read(name, %{entries: entries}) when name in [:weights, :way],
    do: entry(entries, :doing, name) || []

  defp read(name, %{entries: entries}) when name in [:by, :fault],
    do: entry(entries, :doing, name)

  defp read(name, %{entries: entries}) when name in [:pose, :power], do: value(entries, name)

  defp read(name, %{entries: entries}) when name in [:leader, :epoch, :blocked_by],
    do: entries |> entry(:mission, :claim) |> field(name)

  defp read(:says, %{entries: entries}) do
    said = entries |> entry(:mission, :claim) |> field(:says)
    said || astray(value(entries, :uncertainty))
  end

  defp read(:replaced, %{entries: entries}), do: entry(entries, :replaced, :says)
  defp read(:uncertainty, %{entries: entries}), do: entry(entries, :uncertainty, :radius)
  defp read(:arming, %{entries: entries}), do: entry(entries, :arming, :state)
  defp read(:why, %{entries: entries}), do: entry(entries, :arming, :why)
  defp read(:speed, %{entries: entries}), do: entries |> value(:odometry) |> linear()
  defp read(:estop, %{board: board}), do: Board.latched?(board)
  defp read(:estop_by, %{entries: entries}), do: entries |> value(:estop) |> callers()
  defp read(:estop_file, %{board: board}), do: unsaved(Board.unsaved(board))
  defp read(:hung, %{entries: entries}), do: hung(entries)
  defp read(:crashed, %{entries: entries}), do: crashed(entries)
  defp read(:head, %{entries: entries}), do: Sight.head(entries)
  defp read(:age_ms, %{entries: entries}), do: age(entries)
  defp read(:sees, seen), do: Sight.of(seen.config, seen.entries)
  defp read(:frame, seen), do: Frame.of(seen.config, value(seen.entries, :uncertainty))
  defp read(:rejected, %{receiver: receiver}), do: receiver.rejected

  defp read(:hears, %{receiver: receiver, now_ms: now_ms}),
    do: Peers.heard(receiver.peers, now_ms)

  defp read(:view, %{receiver: %{peers: peers}, now_ms: now_ms}),
    do: {Peers.view_number(peers, now_ms), Peers.view(peers, now_ms)}

  defp read(:peers, %{receiver: %{peers: peers}, now_ms: now_ms}),
    do: Map.new(peers.rows, fn {id, _} -> {id, Peers.status(peers, id, now_ms)} end)

  defp read(:health, %{entries: entries}),
    do: for({{:health, device}, {health, _age}} <- entries, into: %{}, do: {device, health})

  defp read(:offline, %{config: config} = seen) do
    for {device, {:offline, reason}} <- read(:health, seen),
        into: %{},
        do: {device, config |> Map.fetch!(device) |> Explanation.offline(reason)}
  end

  # A robot without a mission, too, says why it does not know where it is.
  defp astray(%{place: {_state, reason}}), do: reason
  defp astray(_content), do: nil

  defp callers(nil), do: []
  defp callers(stop), do: EStop.State.callers(stop)

  defp unsaved(nil), do: nil
  defp unsaved({file, reason}), do: "#{:file.format_error(reason)}: #{file}"

  @doc """
  Why its wheels may not turn, as text for people; `nil` if they may, or if that is unknown.
  """
  @spec arming(t()) :: String.t() | nil
  def arming(%__MODULE__{arming: :disarmed, why: nil}), do: "DISARMED"
  def arming(%__MODULE__{arming: :disarmed, why: why}), do: "DISARMED (#{why})"
  def arming(%__MODULE__{arming: {:error, _reason}}), do: "LINE LOST (acknowledge it)"
  def arming(%__MODULE__{}), do: nil

  defp value(entries, key) do
    case entries do
      %{^key => {value, _age_ms}} -> value
      _none -> nil
    end
  end

  # What hangs now, else what hung last.
  defp hung(entries) do
    hung =
      for part <- LivenessMonitor.parts(),
          {{what, module}, ago_ms} <- List.wrap(entries[{:hung, part}]),
          ago_ms < @recently_ms,
          do: {what, LivenessMonitor.words(part, module), ago_ms}

    Enum.min_by(hung, fn {what, _where, ago_ms} -> {what == :hung, ago_ms} end, fn -> nil end)
  end

  # Of both, the later one.
  defp crashed(entries) do
    crashed = for {{:crashed, _part}, {line, age_ms}} <- entries, do: {age_ms, line}
    with {_age_ms, line} <- Enum.min(crashed, fn -> nil end), do: line
  end

  defp entry(entries, key, field), do: entries |> value(key) |> field(field)
  defp field(nil, _key), do: nil
  defp field(map, key), do: Map.get(map, key)

  defp state(%{state: {Manual, :ready}}), do: :idle
  defp state(%{state: {_module, phase}}), do: phase
  defp state(_idle), do: :idle

  defp linear(%Odometry{twist: %Twist{linear: linear}}), do: linear
  defp linear(_no_wheels), do: nil

  defp age(%{odometry: {_value, age_ms}}), do: age_ms
  defp age(_no_wheels), do: nil

  @doc "The fields in the order of the line."
  @spec fields() :: [atom()]
  def fields, do: Keyword.keys(@fields)
end
