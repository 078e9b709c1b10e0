defmodule Tools.Calibrate.Odometry do
  @moduledoc false
  # Runs `mix calibrate odometry`: lets a robot drive courses, asks for tape measurements, estimates the errors of its
  # odometry, and writes the corrections into the robot's file.
  alias Tools.Calibrate.{Live, Options, Plan, Report, RobotFile, Simulated, StdinPrompt}

  alias Console.Cli.Output
  alias Robot.Calibration
  alias Robot.Calibration.{Drive, Keys}
  alias Console.Cli.Format
  alias Hal.Cli.Parse
  alias Hal.Pose

  @degree :math.pi() / 180

  @doc "Runs the command. An error is one line, or several."
  @spec run(Options.t()) :: :ok | {:error, String.t() | [String.t()]}
  def run(%{mode: :simulate} = options), do: Simulated.run(options, Output.to(:stdio))
  def run(%{mode: :typed} = options), do: typed(options)

  def run(%{file: path} = options) do
    with {:ok, file, conversions} <- RobotFile.load(path) do
      {file, conversions} = RobotFile.published(file, conversions)
      Enum.each(Plan.lines(options, file), &IO.puts/1)

      cond do
        options.mode == :dry_run -> :ok
        file.dry_run -> {:error, "#{path}: dry_run is true, so nothing would move"}
        true -> live(options, file, conversions)
      end
    end
  end

  defp live(options, file, conversions) do
    Live.with_robot(file, fn talk ->
      driven = Enum.flat_map(Simulated.tasks(options), &course(&1, file, options, talk))
      finish(driven, options, file, conversions, talk)
    end)
  end

  # Repeats the course until it went well or is skipped.
  defp course(task, file, options, talk) do
    IO.puts("\nNow #{Plan.name(task)}. Put #{file.id} on its mark, and mark its direction.")

    words = ["go", "skip", "quit", "reset", "acknowledge"]

    case StdinPrompt.choose(talk, "go, skip or quit? ", words) do
      {:ok, "go"} ->
        begin_course(task, file, options, talk)

      {:ok, "skip"} ->
        []

      {:ok, "reset"} ->
        :ok = Robot.Safety.Gate.reset(file.id)
        course(task, file, options, talk)

      {:ok, "acknowledge"} ->
        with {:error, line} <- Swarm.acknowledge(file.id), do: IO.puts("  " <> line)
        course(task, file, options, talk)

      _quit_or_end ->
        throw({:quit, "ended by the user; nothing is written"})
    end
  end

  defp begin_course(task, file, options, talk) do
    drive = [legs: Drive.legs(task), speed: Plan.speed(options, file)]

    case Live.drive(file.id, drive, talk, Output.to(:stdio)) do
      {:ok, driven} ->
        measure(task, driven, file, options, talk)

      {:error, line} ->
        IO.puts("  " <> line)

        IO.puts(
          "  (reset releases an emergency stop; acknowledge accepts that the line was lost)"
        )

        course(task, file, options, talk)
    end
  end

  defp measure(task, driven, file, options, talk) do
    {question, check} = question(task)

    case StdinPrompt.ask(talk, question, &answer(&1, check)) do
      {:ok, :again} -> course(task, file, options, talk)
      {:ok, value} -> [{task, Map.merge(driven, measured(task, value))}]
      :eof -> throw({:quit, "there was no answer; nothing is written"})
    end
  end

  defp answer("again", _check), do: {:ok, :again}

  defp answer(text, check) do
    with {:error, allowed} <- check.(text), do: {:error, "#{allowed}, or again"}
  end

  defp typed(options) do
    with {:ok, file, conversions} <- typed_file(options.file) do
      angle = options.angle * @degree

      measured = %{
        distances: for(far <- options.measured, do: {options.distance, far}),
        angles:
          for degrees <- options.turned do
            {if(degrees < 0, do: -angle, else: angle), degrees * @degree}
          end,
        runs: for(xy <- options.cw, do: {:cw, xy}) ++ for(xy <- options.ccw, do: {:ccw, xy}),
        side: options.side
      }

      profile = if file, do: file.profile, else: options.profile
      tell(measured, profile, conversions, options, nil)
    end
  end

  defp typed_file(nil), do: {:ok, nil, nil}

  defp typed_file(path) do
    with {:ok, file, conversions} <- RobotFile.load(path) do
      {file, conversions} = RobotFile.published(file, conversions)
      {:ok, file, conversions}
    end
  end

  defp finish([], _options, _file, _conversions, _talk), do: {:error, "no course was driven"}

  defp finish(driven, options, file, conversions, talk) do
    measured = Simulated.measured(driven, options.side)
    IO.puts("")
    tell(measured, file.profile, conversions, options, talk)
  end

  defp tell(measured, profile, conversions, options, talk) do
    with {:ok, wheels, squares} <- Calibration.estimate(measured, profile.wheel_base) do
      Enum.each(Report.lines(wheels, squares, measured), &IO.puts/1)
      found = Report.found(measured)

      cond do
        options.file == nil -> :ok
        conversions == nil -> IO.puts("its drive has no conversions to correct")
        true -> put(Keys.new(conversions, wheels, found), options, talk)
      end
    end
  end

  defp put(keys, %{write: true, file: path}, _talk), do: RobotFile.write(path, keys, :always)
  defp put(keys, %{file: path}, talk), do: RobotFile.write(path, keys, talk || :never)

  # Asks the questions after a course, and reads the answers. Pure.

  # The question of a course, and the check of its answer (`Tools.Calibrate.StdinPrompt.ask/3`).
  defp question({:distance, way}),
    do:
      {"How far is it from its mark, in a straight line, in metres? ",
       &Parse.number(&1, way / 2, way * 2)}

  defp question({:angle, turn}) do
    far = abs(turn) / @degree

    {"By how many degrees did it turn in all, such as #{Format.decimals(far, 0)}? ",
     &Parse.number(&1, far / 2, far * 2)}
  end

  defp question({:square, _direction, _side}),
    do:
      {"Where does it stand, seen from its mark: X,Y in metres, ahead and to the left? ",
       &Parse.point/1}

  # The measurement: the pose at the end and the turn, as far as this course shows them.
  defp measured({:distance, _way}, far), do: %{measured: Pose.new(far, 0), turn: 0.0}

  defp measured({:angle, turn}, degrees),
    do: %{measured: Pose.new(0, 0), turn: if(turn < 0, do: -degrees, else: degrees) * @degree}

  defp measured({:square, _direction, _side}, {x, y}), do: %{measured: Pose.new(x, y), turn: 0.0}
end
