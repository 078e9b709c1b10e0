defmodule Console.Calibrate.Odometry do
  @moduledoc """
  `mix calibrate odometry`: lets a robot drive what is wanted, asks what a tape says, tells what is wrong, and
  puts it into the robot's file.
  """
  alias Console.Calibrate.{Live, Options, Report, RobotFile, Simulated, Talk}
  alias Console.{Output, Words}
  alias Hal.Pose
  alias Robot.Calibration
  alias Robot.Calibration.{Drive, Keys}

  @degree :math.pi() / 180

  @doc "Does what the options say. An error is one line, or several."
  @spec run(Options.t()) :: :ok | {:error, String.t() | [String.t()]}
  def run(%{mode: :simulate} = options), do: Simulated.run(options, Output.to(:stdio))
  def run(%{mode: :typed} = options), do: typed(options)

  def run(%{file: path} = options) do
    with {:ok, file, conversions} <- RobotFile.load(path) do
      {file, conversions} = begin(file, conversions)
      Enum.each(plan(options, file), &IO.puts/1)
      if options.mode == :dry_run, do: :ok, else: live(options, file, conversions)
    end
  end

  # Without conversions a base neither arms nor tells odometry; with those of another it is off by some percent.
  defp begin(%{drive: {driver, drive}} = file, conversions) when is_list(conversions) do
    published = Keys.published(file.profile.name)
    missing = for {key, _value} <- published, conversions[key] == nil, do: key

    if missing != [],
      do: IO.puts("#{Enum.join(missing, " and ")} not known yet: begins with the published ones")

    conversions = Keyword.merge(published, Enum.reject(conversions, fn {_key, v} -> v == nil end))
    drive = Keyword.put(drive, :conversions, conversions)
    {%{file | drive: {driver, drive}, arm: :manual}, conversions}
  end

  defp begin(file, nil), do: {%{file | arm: :manual}, nil}

  @doc "What will be driven, in lines."
  @spec plan(Options.t(), Robot.File.t()) :: [String.t()]
  def plan(options, file) do
    tasks = Simulated.tasks(options)
    room = Enum.max([1.0, options.distance, if(options.squares > 0, do: options.side, else: 0.0)])

    [
      "#{file.id} will drive, at #{Words.decimals(speed(options, file), 2)} m/s at most:"
      | tasks |> Enum.map(&"  #{name(&1)}: #{legs(&1)}") |> Enum.dedup() |> times(tasks)
    ] ++
      [
        "It needs #{Words.decimals(room + 1, 1)} by #{Words.decimals(room + 1, 1)} m of flat floor, and someone " <>
          "beside it. Clockwise squares lie to the right of its mark, others to the left.",
        "Its wheels turn only when you say go, each time; Enter stops it at once."
      ]
  end

  defp times(lines, tasks) do
    squares = div(Enum.count(tasks, &match?({:square, _, _}, &1)), 2)

    lines
    |> Enum.uniq()
    |> Enum.map(&if(&1 =~ "square", do: &1 <> " (#{squares} times)", else: &1))
  end

  defp speed(options, file),
    do: min(options.speed, file.limits[:max_linear] || file.profile.max_linear)

  defp name({:distance, way}), do: "#{Words.decimals(way, 2)} m straight on"
  defp name({:angle, turn}) when turn > 0, do: "#{degrees(turn)} degrees to the left"
  defp name({:angle, turn}), do: "#{degrees(-turn)} degrees to the right"

  defp name({:square, direction, side}),
    do: "a square of #{Words.decimals(side, 1)} m, #{Calibration.Model.words(direction)}"

  defp legs(task) do
    Enum.map_join(Drive.legs(task), ", ", fn
      {:go, way} -> "go #{Words.decimals(way, 2)}"
      {:turn, turn} -> "turn #{degrees(turn)}"
    end)
  end

  defp degrees(turn), do: Words.decimals(turn / @degree, 0)

  defp live(options, file, conversions) do
    with {:ok, _apps} <- start_apps(),
         {:ok, config} <- Swarm.Start.config(%{file | camera: nil, ptz: nil}),
         {:ok, _pid} <- start(config) do
      talk = Talk.start()

      try do
        with :ok <- Live.ready(file.id) do
          driven = Enum.flat_map(Simulated.tasks(options), &course(&1, file, options, talk))
          finish(driven, options, file, conversions, talk)
        end
      catch
        {:quit, line} -> {:error, line}
      after
        Talk.stop(talk)
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

  # Drives until it went well or is left out.
  defp course(task, file, options, talk) do
    IO.puts("\nNow #{name(task)}. Put #{file.id} on its mark, and mark where it points.")

    case Talk.choose(talk, "go, skip or quit? ", ["go", "skip", "quit"]) do
      {:ok, "go"} ->
        case Live.drive(
               file.id,
               [legs: Drive.legs(task), speed: speed(options, file)],
               talk,
               Output.to(:stdio)
             ) do
          {:ok, driven} ->
            measure(task, driven, file, options, talk)

          {:error, line} ->
            IO.puts("  " <> line)
            course(task, file, options, talk)
        end

      {:ok, "skip"} ->
        []

      _quit_or_end ->
        throw({:quit, "ended by hand; nothing is written"})
    end
  end

  defp measure(task, driven, file, options, talk) do
    {question, check} = question(task)

    case Talk.ask(talk, question, &answer(&1, check)) do
      {:ok, :again} -> course(task, file, options, talk)
      {:ok, value} -> [{task, Map.merge(driven, measured(task, value))}]
      :eof -> throw({:quit, "nobody answers; nothing is written"})
    end
  end

  defp answer("again", _check), do: {:ok, :again}

  defp answer(text, check) do
    with {:error, allowed} <- check.(text), do: {:error, "#{allowed}, or again"}
  end

  defp question({:distance, way}),
    do:
      {"How far is it from its mark, in a straight line, in metres? ",
       &Console.Values.number(&1, way / 2, way * 2)}

  defp question({:angle, turn}) do
    far = abs(turn) / @degree

    {"By how many degrees did it turn in all, such as #{degrees(abs(turn))}? ",
     &Console.Values.number(&1, far / 2, far * 2)}
  end

  defp question({:square, _direction, _side}),
    do:
      {"Where does it stand, seen from its mark: X,Y in metres, ahead and to the left? ",
       &Console.Values.point/1}

  defp measured({:distance, _way}, far), do: %{measured: Pose.new(far, 0), turn: 0.0}

  defp measured({:angle, turn}, degrees),
    do: %{measured: Pose.new(0, 0), turn: if(turn < 0, do: -degrees, else: degrees) * @degree}

  defp measured({:square, _direction, _side}, {x, y}), do: %{measured: Pose.new(x, y), turn: 0.0}

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

      profile = if file, do: file.profile, else: apply(Hal.Profile, options.profile, [])
      tell(measured, profile, conversions, options, nil)
    end
  end

  defp typed_file(nil), do: {:ok, nil, nil}

  defp typed_file(path) do
    with {:ok, file, conversions} <- RobotFile.load(path) do
      {file, conversions} = begin(file, conversions)
      {:ok, file, conversions}
    end
  end

  defp finish([], _options, _file, _conversions, _talk), do: {:error, "nothing was driven"}

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
        conversions == nil -> IO.puts("its drive has no conversions that could be put right")
        true -> put(Keys.new(conversions, wheels, found), options, talk)
      end
    end
  end

  defp put(keys, %{write: true, file: path}, _talk), do: RobotFile.write(path, keys, :always)
  defp put(keys, %{file: path}, talk), do: RobotFile.write(path, keys, talk || :never)
end
