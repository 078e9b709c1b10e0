defmodule Tools.Calibrate.Simulated do
  @moduledoc false
  # Calibrates simulated robots, and compares the result with the true errors of their wheels.
  alias Tools.Calibrate.Report
  alias Console.Cli.{Format, Output, Progress}
  alias Robot.Calibration
  alias Lab.Calibration, as: Simulated

  @goals %{distance: 0.005, base: 0.005, ratio: 0.002}

  @doc "Runs all seeds. `:ok` if all results are within 0.5 % (distance, base) and 0.2 % (ratio)."
  @spec run(Tools.Calibrate.Options.t(), Output.t()) :: :ok | {:error, String.t()}
  def run(options, output) do
    seeds = Enum.to_list(options.seed..(options.seed + options.seeds - 1))
    results = Enum.map(Enum.with_index(seeds), &one(&1, options, output))

    case for {:error, line} <- results, do: line do
      [] -> conclude(for({:ok, errors} <- results, do: errors), output)
      [line | _] -> {:error, line}
    end
  end

  @doc "The tasks of a calibration, in the order in which they are driven."
  @spec tasks(map()) :: [Simulated.task()]
  def tasks(options) do
    angle = options.angle * :math.pi() / 180

    if(options.distance > 0, do: [{:distance, options.distance}], else: []) ++
      if(options.angle > 0, do: [{:angle, angle}, {:angle, -angle}], else: []) ++
      for(
        _n <- 1..options.squares//1,
        direction <- [:cw, :ccw],
        do: {:square, direction, options.side}
      )
  end

  @doc """
  The measurements of the drive, as `Robot.Calibration.estimate/2` takes them.
  """
  @spec measured([{Simulated.task(), Simulated.driven()}], float()) :: Calibration.measured()
  def measured(driven, side) do
    %{
      distances:
        for({{:distance, _}, d} <- driven, do: {length_of(d.told), length_of(d.measured)}),
      angles: for({{:angle, _}, d} <- driven, do: {d.told_turn, d.turn}),
      runs:
        for {{:square, direction, _side}, d} <- driven do
          {direction, {d.measured.x - d.told.x, d.measured.y - d.told.y}}
        end,
      side: side
    }
  end

  defp length_of(pose), do: :math.sqrt(pose.x * pose.x + pose.y * pose.y)

  defp one({seed, index}, options, output) do
    sim =
      Simulated.new(
        seed: seed,
        profile: options.profile,
        noise: options.noise,
        wheels: options.wheels,
        speed: options.speed
      )

    tasks = tasks(options)
    all = length(tasks)

    tasks
    |> Enum.with_index(1)
    |> Enum.reduce_while({[], sim}, fn {task, n}, {driven, sim} ->
      note = "seed #{seed}: #{n} of #{all} courses"
      Output.progress(output, Progress.line(index * all + n, options.seeds * all, note, 80))

      case Simulated.drive(sim, task) do
        {:ok, course, sim} -> {:cont, {[{task, course} | driven], sim}}
        {:error, line, _sim} -> {:halt, {:error, line}}
      end
    end)
    |> judge(seed, options, output)
  end

  defp judge({:error, line}, seed, _options, _output), do: {:error, "seed #{seed}: #{line}"}

  defp judge({driven, sim}, seed, options, output) do
    measured = measured(Enum.reverse(driven), options.side)
    truth = Simulated.truth(sim)

    with {:ok, wheels, squares} <- Calibration.estimate(measured, sim.profile.wheel_base) do
      errors =
        for key <- Report.found(measured),
            do: {key, Map.fetch!(wheels, key) / Map.fetch!(truth, key) - 1}

      if options.seeds == 1,
        do: Enum.each(Report.lines(wheels, squares, measured), &Output.line(output, &1))

      Output.line(
        output,
        "seed #{seed}: found " <> Enum.map_join(errors, ", ", &found(&1, wheels, truth))
      )

      {:ok, errors}
    end
  end

  defp found({key, error}, wheels, truth) do
    "#{key} #{Format.decimals(Map.fetch!(wheels, key), 4)} of #{Format.decimals(Map.fetch!(truth, key), 4)} " <>
      "(#{Format.decimals(100 * error, 3)} % off)"
  end

  defp conclude(all, output) do
    for key <- [:distance, :base, :ratio],
        errors = for(found <- all, {^key, error} <- found, do: abs(error)),
        errors != [] do
      goal = @goals[key]
      within = Enum.count(errors, &(&1 <= goal))

      Output.line(
        output,
        "#{key}: at most #{Format.decimals(100 * Enum.max(errors), 3)} % off, " <>
          "#{within} of #{length(errors)} within #{100 * goal} %"
      )

      within == length(errors)
    end
    |> Enum.all?()
    |> if(do: :ok, else: {:error, "not all results were exact enough"})
  end
end
