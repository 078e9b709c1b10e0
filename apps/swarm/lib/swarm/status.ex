defmodule Swarm.Status do
  @moduledoc """
  Describes a robot's status, for people. In `iex` it prints as one line:

      #mag1 follow (1.20, -0.35, 90 deg) ±0.12 m, 0.31 m/s by follow, view 7, hears 4 but not min2, age 40 ms

  The number after the pose is its uncertainty: in 95 of 100 cases the robot is no farther from it
  (`uncertainty`, metres; `Robot.Percept`). A follower's pose is in its leader's frame, any other
  robot's in that of its start pose (`frame`; `Swarm.Status.Frame`). `epoch` counts the
  elections that its mission knows of.

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

  After the age stands where its camera looks (`head`), and what that shows of the landmark (`sees`; `Swarm.Status.Sight`), of
  robots that have a pan-tilt unit and a camera: `looks at 12, 0 deg (zoom 49 deg), sees YellowLandmark at -12 deg, 2.31 m`.

  A robot whose machine has no network says `NO NETWORK`, and why (`network`; `Mesh.fault/0`).

  The status of a robot that does not answer comes from its row on the blackboard (`from: :row`),
  with that age: `…, age 1240 ms by its row`.
  """
  alias Hal.Device.Words
  alias Hal.{Odometry, Pose, Twist}
  alias Robot.Board
  alias Robot.Safety.LivenessMonitor
  alias Swarm.EStop
  alias Swarm.Message.Receiver
  alias Swarm.Membership.Peers
  alias Swarm.Status.{Frame, Sight}

  @recently_ms 60_000

  @enforce_keys [:robot]
  defstruct @enforce_keys ++
              [
                from: :robot,
                node: nil,
                state: :idle,
                by: nil,
                weights: [],
                way: [],
                pose: nil,
                uncertainty: nil,
                frame: nil,
                speed: 0.0,
                limits: [],
                estop: false,
                estop_by: [],
                estop_file: nil,
                arming: nil,
                why: nil,
                hung: nil,
                crashed: nil,
                leader: nil,
                epoch: nil,
                blocked_by: nil,
                says: nil,
                power: nil,
                health: %{},
                offline: %{},
                fault: nil,
                replaced: nil,
                peers: %{},
                hears: [],
                view: nil,
                rejected: %{},
                network: nil,
                head: nil,
                sees: nil,
                age_ms: nil
              ]

  @type view :: {number :: non_neg_integer(), members :: [atom()]}
  @type t :: %__MODULE__{
          robot: atom(),
          from: :robot | :row,
          node: node() | String.t() | nil,
          state: atom() | String.t(),
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
          head: Sight.head(),
          sees: Sight.t(),
          age_ms: non_neg_integer() | nil
        }

  @doc "The status of a robot of this node, from its board and its receiver."
  @spec of(Robot.Config.t(), Board.t(), Receiver.t()) :: t()
  def of(config, board, receiver) do
    entries = Board.entries(board)
    driving = value(entries, :driving)
    mission = value(entries, :mission)
    now_ms = Robot.Config.now(config)
    health = for {{:health, device}, {condition, _age}} <- entries, do: {device, condition}

    %__MODULE__{
      robot: config.id,
      node: node(),
      state: state(mission),
      by: entries |> value(:doing) |> field(:by),
      weights: entries |> value(:doing) |> field(:weights) || [],
      way: entries |> value(:doing) |> field(:way) || [],
      fault: entries |> value(:doing) |> field(:fault),
      replaced: entries |> value(:replaced) |> field(:says),
      pose: value(entries, :pose),
      uncertainty: entries |> value(:uncertainty) |> field(:radius),
      frame: Frame.of(config, value(entries, :uncertainty)),
      speed: entries |> value(:odometry) |> linear(),
      limits:
        (entries |> value(:doing) |> field(:limits) || []) ++ (field(driving, :limits) || []),
      estop: Board.latched?(board),
      estop_by: entries |> value(:estop) |> callers(),
      estop_file: unsaved(Board.unsaved(board)),
      arming: entries |> value(:arming) |> field(:state),
      why: entries |> value(:arming) |> field(:why),
      hung: hung(entries),
      crashed: crashed(entries),
      leader: mission |> field(:claim) |> field(:leader),
      epoch: mission |> field(:claim) |> field(:epoch),
      blocked_by: mission |> field(:claim) |> field(:blocked_by),
      says: mission |> field(:claim) |> field(:says),
      power: value(entries, :power),
      health: Map.new(health),
      offline:
        for(
          {device, {:offline, reason}} <- health,
          into: %{},
          do: {device, words(config, device, reason)}
        ),
      peers:
        Map.new(receiver.peers.rows, fn {id, _} ->
          {id, Peers.status(receiver.peers, id, now_ms)}
        end),
      hears: Peers.heard(receiver.peers, now_ms),
      view: {Peers.view_number(receiver.peers, now_ms), Peers.view(receiver.peers, now_ms)},
      rejected: receiver.rejected,
      network: Mesh.fault(),
      head: Sight.head(entries),
      sees: Sight.of(config, entries),
      age_ms: age(entries)
    }
  end

  defp callers(nil), do: []
  defp callers(stop), do: EStop.State.callers(stop)

  defp unsaved(nil), do: nil
  defp unsaved({file, reason}), do: "#{:file.format_error(reason)}: #{file}"

  defp words(config, device, reason),
    do: config |> Map.fetch!(device) |> Words.offline(reason)

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

  defp field(nil, _key), do: nil
  defp field(map, key), do: Map.get(map, key)

  defp state(%{state: {Robot.Mission.Manual, :ready}}), do: :idle
  defp state(%{state: {_module, phase}}), do: phase
  defp state(_idle), do: :idle

  defp linear(%Odometry{twist: %Twist{linear: linear}}), do: linear
  defp linear(_no_wheels), do: nil

  defp age(%{odometry: {_value, age_ms}}), do: age_ms
  defp age(_no_wheels), do: nil

  defimpl Inspect do
    # At most so many robots that it does not hear are named.
    @named 3

    def inspect(status, _options) do
      [first | rest] = [speed(status) | remarks(status)]
      words = ["#{status.robot} #{status.state} #{place(status)} #{first}" | rest]
      "#" <> Enum.join(words, ", ")
    end

    defp place(%{pose: nil}), do: "(pose unknown)"

    defp place(%{pose: %{x: x, y: y, heading: heading}, uncertainty: metres}) do
      degrees = round(heading * 180 / :math.pi())

      "(#{fixed(x)}, #{fixed(y)}, #{degrees} deg)" <>
        if(metres, do: " #{within(metres)},", else: "")
    end

    defp within(metres), do: "±#{fixed(metres)} m"

    defp speed(%{speed: nil}), do: "speed unknown"

    defp speed(status),
      do: "#{fixed(status.speed)} m/s" <> if(status.by, do: " by #{status.by}", else: "")

    defp remarks(status) do
      offline = for {device, {:offline, _}} <- status.health, do: offline(status, device)
      dropped = status.rejected |> Map.values() |> Enum.sum()

      [
        status.estop && "E-STOP" <> by(status.estop_by),
        unsaved(status),
        Swarm.Status.arming(status),
        status.fault && "FAULT (#{status.fault})",
        limited?(status, "blind") && "BLIND (no sonar; slow)",
        limited?(status, "caution") && "CAUTIOUS (another robot may be near; slow)",
        hung(status.hung),
        status.crashed && "CRASHED #{status.crashed}",
        status.blocked_by && "BLOCKED by #{status.blocked_by}",
        is_binary(status.says) && status.says,
        status.replaced,
        status.leader && "leader #{status.leader}",
        status.view && "view #{elem(status.view, 0)}",
        "hears #{length(status.hears)}" <> deaf(status),
        status.network && "NO NETWORK (#{status.network})",
        dropped > 0 && "dropped #{dropped} messages",
        "age #{status.age_ms || "?"} ms" <> if(status.from == :row, do: " by its row", else: ""),
        Swarm.Status.Sight.words(status.head),
        Swarm.Status.Sight.words(status.sees)
      ]
      |> Enum.filter(& &1)
      |> Kernel.++(offline)
    end

    defp by([]), do: ""
    defp by(callers), do: " by #{Enum.join(callers, ", ")}"

    defp limited?(status, limit), do: Enum.any?(status.limits, &("#{&1}" == limit))

    defp offline(%{offline: lines}, device) do
      case lines do
        %{^device => line} -> "#{device} offline (#{line})"
        _not_told -> "#{device} offline"
      end
    end

    defp unsaved(%{estop_file: nil}), do: nil
    defp unsaved(%{estop: true} = status), do: "E-STOP NOT ON ITS DISK (#{status.estop_file})"
    defp unsaved(status), do: "RESET NOT ON ITS DISK (#{status.estop_file})"

    defp hung(nil), do: nil
    defp hung({:silent, where, _ago_ms}), do: "HANGS in #{where}"

    defp hung({:hung, where, ago_ms}),
      do: "HUNG in #{where} #{div(ago_ms, 1_000)} s ago, started again"

    # The robots of the view that are known only by way of others; nearly always none.
    defp deaf(%{view: {_number, members}} = status) do
      case Enum.split(members -- [status.robot | status.hears], @named) do
        {[], []} -> ""
        {names, []} -> " but not #{Enum.join(names, " ")}"
        {names, more} -> " but not #{Enum.join(names, " ")} and #{length(more)} more"
      end
    end

    defp deaf(_unknown), do: ""

    defp fixed(number), do: :erlang.float_to_binary(number * 1.0, decimals: 2)
  end
end
