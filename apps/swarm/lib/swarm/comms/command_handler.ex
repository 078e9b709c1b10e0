defmodule Swarm.Comms.CommandHandler do
  @moduledoc """
  Handles the commands of people (`Swarm`) for the robot's comms (`Swarm.Comms`), which people on
  any node find in the directory: it answers from the board, refuses what is
  not possible with an error of one line, and passes the rest, with the address for the answer, to
  the part that carries it out. That part tells the outcome: the drive's device; or the pilot, if it
  refuses, and the executive, when it has received the order. `Swarm.EStop` handles stops and the
  reset.

  | request | answer |
  |---|---|
  | `:status` | `Swarm.Status` |
  | `:ping` | `{:ok, line}`: name, uptime and state (`Swarm.Comms.PingReply`) |
  | `:keep` | `{:ok, line}`: its last minute is written as a recording; or that it keeps none |
  | `:sonar` | `{:ok, [{where, metres}]}`: what its sonars measured last, or why that is not known |
  | `:layer` | `{:ok, layer}`: what its mission draws over the map (`t:Robot.Mission.layer/0`), or that it is too much |
  | `:start`, `{:start, options}` | the group's mission starts; with options it starts again |
  | `{:start, mission, options}` | that mission starts, whatever runs (`Swarm.MissionRegistry`) |
  | `{:formation, kind, spacing}` | for the running mission |
  | `{:send, text}` | a message of a person to the running mission, of a kind that it hears from people (`Swarm.MissionRegistry.Text.message/2`) |
  | another `Robot.Command` | for this robot alone, which leaves the group's mission for it |
  | `:present` | a person looks after the robot (`Swarm.present/0`) |
  | `:arm`, `:acknowledge` | for the wheels (`Hal.Device`): done, or why not |

  While the emergency stop holds a robot, it refuses to be armed and all commands that would move
  it. The latter are also refused, with the reason, while its drive is offline or not armed
  (`Robot.Safety.Readiness`); otherwise the motion would begin later, when it is armed. A `goto` to a place that the
  robot cannot reach by what it knows of walls is refused, too (`Nav.Reach`).
  """
  alias Hal.{Device, Pose}
  alias Robot.{Board, Names}
  alias Robot.Control.Delivery
  alias Robot.Percept.Snapshot
  alias Robot.Safety.{Gate, LivenessMonitor, Readiness}
  alias Robot.Mission.Manual
  alias Nav.{Grid, Reach}
  alias Mesh.Nonblocking
  alias Swarm.{BehaviourRegistry, MissionRegistry, Replacement, Status}
  alias Swarm.MissionRegistry.Text
  alias Swarm.Order
  alias Swarm.Order.Freshness
  alias Swarm.Comms.PingReply
  alias Swarm.EStop.Answer
  alias Swarm.Message.Receiver

  # The caller waits for half a second (`Swarm.Commands.Client`); after that nothing may begin.
  @carry_out_ms 400
  # Readings that are older tell nothing of now.
  @recent_ms 1_000
  # Some 3,000 places of what a mission draws.
  @most_drawn_bytes 65_536
  # The drive may begin at the last moment, and takes some time.
  @drive_ms 50

  @doc """
  The effects (`t:Robot.Role.effect/0`) of a request that was made at `asked_us` and is handled at `now_us`
  (`System.monotonic_time/1`, microseconds), which is `at_ms` by the robot's clock. The
  process behind `ref` gets the outcome (`Mesh.Nonblocking.answer/2`).
  """
  @spec take(
          term(),
          {reference(), giver :: String.t() | nil, asked_us :: integer(), now_us :: integer()},
          %{:config => Robot.Config.t(), :receiver => Receiver.t(), optional(atom()) => term()},
          at_ms :: integer(),
          Board.t() | Board.entries()
        ) :: [Robot.Role.effect()]
  def take(request, {ref, giver, asked_us, now_us}, %{receiver: receiver} = comms, at_ms, board) do
    config = Replacement.config(comms.config, board)

    case judge(request, config, board, {receiver, at_ms}) do
      :present ->
        [{:cast, :gate, {:present, div(now_us - asked_us, 1_000)}}, {:reply, ref, :ok}]

      :keep ->
        [{:cast, :incidents, {:keep, config.id, ref}}]

      {:drive, order} ->
        drive(order, config.id, {ref, giver}, {asked_us, now_us})

      {:mission, ways, command} ->
        deliver(ways, command, {ref, giver}, {asked_us, now_us, at_ms})

      answer ->
        [{:reply, ref, answer}]
    end
  end

  # A robot in lockstep has no such words.
  defp judge(question, %{id: id}, %{} = board, _heard)
       when question in [:status, :ping, :keep, :sonar, :layer] and not is_struct(board),
       do: {:error, "#{id} answers no #{question} in lockstep"}

  defp judge(:status, config, board, {receiver, _at_ms}), do: Status.of(config, board, receiver)

  defp judge(:ping, config, board, {receiver, _at_ms}),
    do: {:ok, PingReply.line(config, board, Status.of(config, board, receiver))}

  defp judge(:keep, %{id: id}, _board, _heard) do
    if Names.whereis(id, :incidents),
      do: :keep,
      else: {:error, "#{id} does not keep its last minute: its file has no incidents:"}
  end

  defp judge(:sonar, config, board, {_receiver, at_ms}) do
    recent = fn key, _limit_ms -> Board.fetch(board, key, @recent_ms, at_ms) end

    case Snapshot.ranges(config.profile, recent) do
      {_body, nil} ->
        {:error, "#{config.id}: its sonars say nothing"}

      {body, ranges} ->
        {:ok,
         for({_pose, range} = heard <- Enum.zip(body.sonars, ranges), range != nil, do: heard)}
    end
  end

  defp judge(:layer, config, board, _heard) do
    layer =
      with {:ok, %{layer: layer}, _at_ms} <- Board.fetch(board, :mission, :infinity, 0),
           do: layer,
           else: (_idle -> [])

    if :erlang.external_size(layer) <= @most_drawn_bytes,
      do: {:ok, layer},
      else: {:error, "#{config.id}: its mission draws too much to be sent"}
  end

  defp judge(:present, _config, _board, _heard), do: :present
  defp judge(:acknowledge, _config, _board, _heard), do: {:drive, :acknowledge}

  # A command that is accepted while all robots are stopped would begin with the reset.
  defp judge(request, config, board, heard) do
    if Board.latched?(board), do: held(config.id), else: free(request, config, board, heard)
  end

  defp free(:arm, _config, _board, _heard), do: {:drive, :arm}

  defp free(request, config, board, heard) do
    with {:ok, request} <- checked(request, config, board),
         :ok <- well(config, board),
         :ok <- ready(request, config, board),
         :ok <- attended(config, board, heard),
         :ok <- possible(request, config, board, heard),
         {:ok, ways} <- ways(request, config),
         do: {:mission, ways, command(request)}
  end

  # A drive that hangs does not answer, so comms has to; of two answers only the first
  # arrives.
  defp drive(order, id, {ref, giver}, {asked_us, now_us}) do
    until_ms = div(asked_us, 1_000) + @carry_out_ms
    reply = {__MODULE__, :ordered, [id, ref, {order, giver}]}
    unanswered = {:unanswered, ref, {:error, "#{id}: the drive does not answer"}}

    [
      {:apply, {Device, :order_later, [Names.via(id, :drive), order, until_ms, reply]}},
      {:after, max(until_ms + @drive_ms - div(now_us, 1_000), 1), unanswered}
    ]
  end

  # By the robot's clock, which need not be the one of `asked_us`.
  defp deliver(ways, command, {ref, giver}, {asked_us, now_us, at_ms}) do
    delivery = %Delivery{
      ways: ways,
      asked: asked_us,
      by: giver,
      until_ms: at_ms + @carry_out_ms - div(now_us - asked_us, 1_000),
      reply: {:cast, :comms, {:delivered, command, ref, giver}}
    }

    [{:cast, :pilot, {:deliver, delivery, {:command, command}}}]
  end

  @doc """
  Called by the drive's device with the outcome of an order for the wheels; answers the caller.
  """
  @spec ordered(
          atom(),
          reference(),
          {order :: atom(), giver :: String.t() | nil},
          :ok | {:error, line :: String.t()}
        ) :: :ok
  def ordered(id, ref, {order, giver}, :ok) do
    if giver, do: Answer.obeyed(id, order, giver)
    Nonblocking.answer(ref, :ok)
  end

  def ordered(id, ref, _order, {:error, line}),
    do: Nonblocking.answer(ref, {:error, "#{id}: #{line}"})

  @doc "Whether a term is the outcome of an order at pilot or executive, which has an answer."
  @spec outcome?(term()) :: boolean()
  def outcome?({:error, why}),
    do: is_binary(why) or why in [:held, :idle, :no_mission, :late, :stopped]

  def outcome?(other), do: other == :ok

  @doc "The answer to a person's order for the mission, by its outcome at pilot or executive."
  @spec answer(:ok | Delivery.refusal(), robot :: atom(), command :: term()) ::
          :ok | {:error, :no_formation | (line :: String.t())}
  def answer(:ok, _id, _command), do: :ok
  def answer({:error, :held}, id, _command), do: held(id)

  def answer({:error, :idle}, id, {:message, _kind, _fields}),
    do: {:error, "#{id} has another mission by now; repeat the message"}

  def answer({:error, :idle}, _id, _formation), do: {:error, :no_formation}
  def answer({:error, :no_mission}, id, _start), do: {:error, "#{id} has no such mission"}
  def answer({:error, line}, id, _command) when is_binary(line), do: {:error, "#{id}: #{line}"}

  def answer({:error, :late}, id, _command),
    do: {:error, "#{id} answers too late; repeat the command"}

  def answer({:error, :stopped}, id, _command), do: Freshness.refusal(id, :stopped)

  defp held(id), do: {:error, "#{id} is held by the emergency stop; reset it first"}

  # People use `Swarm`, which has checked everything; but any process may send something here.
  defp checked({:send, _text} = request, %{id: id}, board) do
    with {:ok, {:send, text}} <- Order.check(request),
         {:error, line} <- Text.message(Board.fetch(board, :mission, :infinity, 0), text),
         do: {:error, "#{id}: #{line}"}
  end

  defp checked(request, config, _board), do: checked(request, config)

  defp checked({:start, options}, config) do
    with {:ok, {:start, options}} <- Order.check({:start, options}),
         {:ok, {module, _defaults}} <- mission(config),
         {:ok, options} <- MissionRegistry.options(module, options, nil),
         do: {:ok, {:start, options}}
  end

  defp checked({:start, mission, options}, _config) do
    with {:ok, _order} <- Order.check({:start, mission, options}),
         {:ok, {module, options}} <- MissionRegistry.choose({mission, options}, nil),
         do: {:ok, {:start, module, options}}
  end

  defp checked({:run, behaviour, options}, _config) do
    with {:ok, _order} <- Order.check({:run, behaviour, options}),
         {:ok, {module, options}} <- BehaviourRegistry.choose(behaviour, options),
         do: {:ok, {:run, module, options}}
  end

  defp checked(request, _config), do: Order.check(request)

  # A pilot that hangs would not answer, and the caller would not know why. A gate that hangs is
  # killed, and with it ends what was begun.
  defp well(%{id: id}, board) do
    hangs =
      for part <- [:gate, :pilot],
          {:ok, {:silent, module}, _at_ms} <- [Board.fetch(board, {:hung, part}, :infinity, 0)],
          do: LivenessMonitor.words(part, module)

    cond do
      hangs != [] -> {:error, "#{id} hangs in #{hd(hangs)}; it restarts by itself"}
      Replacement.changing?(board) -> {:error, "#{id} is being given another mission; repeat it"}
      true -> :ok
    end
  end

  # A formation moves only robots that are on a mission, and those are ready.
  defp ready({:formation, _kind, _spacing}, _config, _board), do: :ok

  defp ready(_request, config, board) do
    with {:error, line} <- Readiness.of(config, board), do: {:error, "#{config.id}: #{line}"}
  end

  defp attended(%{presence: nil}, _board, _heard), do: :ok

  defp attended(%{presence: seconds, id: id}, board, {_receiver, at_ms}) do
    heard_ms = Gate.heard(board)

    if heard_ms != nil and at_ms - heard_ms <= seconds * 1_000,
      do: :ok,
      else:
        {:error,
         "#{id} moves only while a person's page, pad or bin/presence is heard, and none has been for #{seconds} s"}
  end

  defp possible(
         {:goto, x, y, _heading},
         %{plan: %Grid{} = plan, profile: profile, id: id},
         board,
         _heard
       ) do
    with {:error, why} <- Reach.check(plan, place(board), {x, y}, profile.radius),
         do: {:error, "#{id} cannot go to #{x},#{y}: #{Reach.words(why)}"}
  end

  defp possible({:follow_the_leader, leader}, %{id: id}, _board, {receiver, at_ms}),
    do: Order.follow(id, leader, Receiver.leaders(receiver, at_ms))

  defp possible({:look, _pan}, %{ptz: nil, id: id}, _board, _heard),
    do: {:error, "#{id} has no camera that it could turn"}

  defp possible({:look, pan}, %{profile: %{camera: %{max_pan: most}}, id: id}, _board, _heard)
       when abs(pan) > most,
       do: {:error, "#{id} turns its camera by #{most} rad at most to each side, not by #{pan}"}

  defp possible({:find_blob, colour}, config, _board, _heard), do: known(colour, config)
  defp possible(_request, _config, _board, _heard), do: :ok

  defp place(board) do
    case Board.fetch(board, :pose, :infinity, 0) do
      {:ok, %Pose{} = pose, _at_ms} -> Pose.point(pose)
      _unknown -> nil
    end
  end

  defp known(_colour, %{camera: nil, id: id}), do: {:error, "#{id} has no camera to look with"}
  defp known(nil, _config), do: :ok

  defp known(colour, %{id: id, colours: %{classes: classes}}) do
    names = Enum.map(classes, & &1.name)

    if colour in names,
      do: :ok,
      else:
        {:error, "#{id} does not know the colour #{inspect(colour)}; it looks for #{list(names)}"}
  end

  defp list([name]), do: name
  defp list(names), do: Enum.join(names, ", ")

  # The ways of a command to the robot's mission. What people asked of it survives a stop of it.
  defp ways(:start, config), do: ways({:start, []}, config)

  defp ways({:start, []}, config) do
    with {:ok, anew} <- begin([], config),
         do: {:ok, [{:hand, {:except, Manual}}, :resume, anew]}
  end

  defp ways({:start, options}, config),
    do: with({:ok, anew} <- begin(options, config), do: {:ok, [anew]})

  defp ways({:start, module, options}, _config), do: {:ok, [{:start, module, options}]}
  defp ways({:formation, _kind, _spacing}, _config), do: {:ok, [{:hand, {:taking, :formation}}]}

  # What was checked by a mission's table is for that mission alone.
  defp ways({:message, mission, _kind, _fields}, _config),
    do: {:ok, [{:hand, {:only, mission}}]}

  # A mission may name such a command as one of its own.
  defp ways(alone, _config) do
    own = {:hand, {:naming, Robot.Command.name(alone)}}
    {:ok, [own, {:hand, {:only, Manual}}, {:start, Manual, []}]}
  end

  defp begin(options, config) do
    with {:ok, {module, defaults}} <- mission(config),
         do: {:ok, {:start, module, Keyword.merge(defaults, options)}}
  end

  defp mission(%{mission: nil}),
    do: with({:ok, module} <- MissionRegistry.default(), do: {:ok, {module, []}})

  defp mission(%{mission: mission}), do: {:ok, mission}

  # What the mission gets of a command that took one of its ways.
  defp command({:start, _options}), do: :start
  defp command({:start, _module, _options}), do: :start
  defp command({:message, _mission, kind, fields}), do: {:message, kind, fields}
  defp command(request), do: request
end
