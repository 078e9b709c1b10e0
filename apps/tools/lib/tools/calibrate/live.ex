defmodule Tools.Calibrate.Live do
  @moduledoc false
  # Drives a robot of this node along one course, through everything between a wish and its wheels:
  # mission, executive, gate, device. A person starts each course; the wheels are armed for this
  # course alone. Any input meanwhile is an emergency stop, which holds until the person types
  # `reset`.
  alias Tools.Calibrate.StdinPrompt
  alias Console.Cli.{Format, Output}
  alias Hal.Pose
  alias Robot.Board
  alias Robot.Control.Pilot
  alias Robot.Safety.Gate
  alias Robot.Calibration.Drive

  @look_ms 100
  @ready_ms 5_000
  # The time from the command to stop until odometry shows it.
  @fresh_ms 500
  # Below these speeds of odometry (m/s, rad/s) the robot counts as standing.
  @still_linear 0.006
  @still_turn 0.01

  @type driven :: %{told: Pose.t(), told_turn: float()}

  @doc """
  Starts the robot of a file on this node, without camera and fence, calls a function with a prompt once it is ready, and ends it
  again. A function that throws `{:quit, line}` ends with that error.
  """
  @spec with_robot(Robot.File.t(), (StdinPrompt.t() -> result)) :: result | {:error, String.t()}
        when result: term()
  def with_robot(file, fun) do
    with {:ok, _apps} <- start_apps(),
         # The robot is carried to its mark by hand, so it does not know where a fence is.
         {:ok, config} <- Swarm.MemberSpec.config(%{file | camera: nil, ptz: nil, fence: nil}),
         {:ok, _pid} <- start(config) do
      talk = StdinPrompt.start()

      try do
        with :ok <- ready(file.id), do: fun.(talk)
      catch
        {:quit, line} -> {:error, line}
      after
        StdinPrompt.stop(talk)
        Robot.Fleet.stop_robot(Robot.Fleet, file.id)
      end
    end
  end

  defp start_apps do
    with {:error, {app, reason}} <- Application.ensure_all_started(:swarm),
         do: {:error, "#{app} does not start: #{inspect(reason, limit: 5)}"}
  end

  defp start(config) do
    with {:error, reason} <- Robot.Fleet.start_robot(Robot.Fleet, config),
         do: {:error, "#{config.id} does not start: #{inspect(reason, limit: 5)}"}
  end

  @doc """
  What these sensors of a robot tell in each of some looks, 0.2 s apart; fewer while they say nothing.
  """
  @spec ranges(atom(), :sonar | :ir, looks :: pos_integer()) :: [[float()]]
  def ranges(robot, key, looks) do
    for _look <- 1..looks, ranges = look(robot, key), do: ranges
  end

  defp look(robot, key) do
    wait(fn ->
      wait(fn ->
        with {:ok, board} <- Board.find(robot),
             {:ok, ranges, _at_ms} <- Board.fetch(board, key, @fresh_ms),
             do: ranges,
             else: (:error -> nil)
      end)
    end)
  end

  @doc """
  Waits until the robot's drive is online and ready. The error says what is missing.
  """
  @spec ready(atom(), non_neg_integer()) :: :ok | {:error, String.t()}
  def ready(robot, patience_ms \\ @ready_ms) do
    cond do
      odometry(robot) != nil and lacks(robot) == nil -> :ok
      patience_ms <= 0 -> {:error, "#{robot} cannot drive: #{why(robot)}"}
      true -> wait(fn -> ready(robot, patience_ms - @look_ms) end)
    end
  end

  defp lacks(robot), do: with(%{why: line} <- entry(robot, :arming), do: line)

  defp why(robot) do
    case Swarm.status(robot) do
      %{offline: %{drive: line}} -> "its drive is offline (#{line})"
      _online_or_unknown -> lacks(robot) || "its base reports no odometry"
    end
  end

  @doc """
  Drives one course. `{:error, line}` if it was not driven to its end; then the wheels are
  disarmed.
  """
  @spec drive(atom(), keyword(), StdinPrompt.t(), Output.t()) ::
          {:ok, driven()} | {:error, String.t()}
  def drive(robot, course, talk, output) do
    StdinPrompt.forget(talk)

    with :ok <- Swarm.arm(robot),
         {:ok, start} <- standing(robot),
         :ok <- Pilot.start(robot, Drive, course) do
      s = %{
        robot: robot,
        talk: talk,
        output: output,
        start: start,
        last: start.heading,
        turned: 0.0
      }

      result = watch(s)
      Pilot.stop(robot)
      Output.finish(output)
      disarm(robot, result)
    else
      {:error, line} when is_binary(line) -> {:error, line}
      {:error, reason} -> {:error, "#{robot} cannot drive: #{inspect(reason)}"}
    end
  end

  defp disarm(robot, result) do
    case Swarm.disarm(robot) do
      :ok -> result
      {:error, line} -> {:error, line}
    end
  end

  defp watch(s) do
    ref = s.talk.ref

    receive do
      {^ref, word} when word != :eof -> stopped(s)
    after
      @look_ms -> s |> look() |> judge()
    end
  end

  defp stopped(s) do
    saved = Gate.estop(s.robot)
    Output.finish(s.output)
    IO.puts("EMERGENCY STOP: #{s.robot} is held#{unsaved(saved)}")

    with {:ok, "reset"} <-
           StdinPrompt.choose(s.talk, "type reset to let it drive again: ", ["reset"]),
         do: Gate.reset(s.robot)

    {:error, "stopped by the user"}
  end

  defp unsaved(:ok), do: ""

  defp unsaved({:error, {file, reason}}),
    do:
      ", but would not be after a restart: #{file} cannot be written (#{:file.format_error(reason)})"

  defp look(s) do
    case odometry(s.robot) do
      nil ->
        s

      %{pose: pose} ->
        turned = s.turned + Pose.wrap(pose.heading - s.last)
        %{s | last: pose.heading, turned: turned} |> tell(pose)
    end
  end

  defp tell(s, pose) do
    at = Pose.relative(s.start, pose)

    limits =
      with %{limits: [_ | _] = limits} <- entry(s.robot, :driving),
           do: ", limited: #{Enum.join(limits, " ")}",
           else: (_none -> "")

    Output.progress(
      s.output,
      "by odometry #{Format.decimals(at.x, 2)},#{Format.decimals(at.y, 2)} m, turned " <>
        "#{Format.decimals(s.turned * 180 / :math.pi(), 0)} degrees#{limits}; Enter stops it"
    )

    s
  end

  defp judge(s) do
    case entry(s.robot, :mission) do
      %{state: {Drive, :driving}} ->
        watch(s)

      %{state: {Drive, :done}} ->
        arrived(s)

      %{state: {Drive, :blocked}} ->
        {:error, "it touched something or could not go on#{limits(s)}"}

      _idle_or_gone ->
        {:error, "the drive was ended by a stop, an emergency stop or a fault"}
    end
  end

  defp limits(s) do
    case {entry(s.robot, :driving), entry(s.robot, :arming)} do
      {_driving, %{state: state}} when state != :armed -> "; its wheels are #{inspect(state)}"
      {%{limits: [_ | _] = limits}, _arming} -> "; limited: #{Enum.join(limits, " ")}"
      _nothing -> ""
    end
  end

  # The course ends when the wheels stand still.
  defp arrived(s) do
    case odometry(s.robot) do
      nil -> {:error, "it reported no odometry at its end"}
      %{pose: pose} -> {:ok, %{told: Pose.relative(s.start, pose), told_turn: look(s).turned}}
    end
  end

  # The pose from which the course is measured, by a reading that is newer than the question: after a
  # course that was ended early the robot may still roll.
  defp standing(robot) do
    case Board.find(robot) do
      {:ok, board} -> standing(robot, Board.now(board), @ready_ms)
      :error -> {:error, "#{robot} does not run"}
    end
  end

  defp standing(robot, asked_ms, patience_ms) do
    case reading(robot) do
      {%{pose: pose, twist: twist}, at_ms} when at_ms > asked_ms ->
        if abs(twist.linear) < @still_linear and abs(twist.turn) < @still_turn,
          do: {:ok, pose},
          else: stand_longer(robot, asked_ms, patience_ms, "does not stand still")

      _old_or_none ->
        stand_longer(robot, asked_ms, patience_ms, "reports no odometry")
    end
  end

  defp stand_longer(robot, _asked_ms, patience_ms, why) when patience_ms <= 0,
    do: {:error, "#{robot} #{why}"}

  defp stand_longer(robot, asked_ms, patience_ms, _why),
    do: wait(fn -> standing(robot, asked_ms, patience_ms - @look_ms) end)

  defp odometry(robot), do: with({odometry, _at_ms} <- reading(robot), do: odometry)

  defp reading(robot) do
    with {:ok, board} <- Board.find(robot),
         {:ok, odometry, at_ms} <- Board.fetch(board, :odometry, @fresh_ms),
         do: {odometry, at_ms},
         else: (:error -> nil)
  end

  defp entry(robot, key) do
    with {:ok, board} <- Board.find(robot),
         {:ok, value, _at_ms} <- Board.fetch(board, key, :infinity),
         do: value,
         else: (:error -> nil)
  end

  defp wait(continue) do
    receive do
    after
      @look_ms -> continue.()
    end
  end
end
