defmodule Tools.Calibrate.Plan do
  @moduledoc "Describes what a calibration of odometry will drive. Pure."
  alias Tools.Calibrate.{Options, Simulated}
  alias Console.Cli.Format
  alias Robot.Calibration
  alias Robot.Calibration.Drive

  @degree :math.pi() / 180

  @doc "What will be driven, as lines of text."
  @spec lines(Options.t(), Robot.File.t()) :: [String.t()]
  def lines(options, file) do
    tasks = Simulated.tasks(options)
    room = Enum.max([1.0, options.distance, if(options.squares > 0, do: options.side, else: 0.0)])

    [
      "#{file.id} will drive, at #{Format.decimals(speed(options, file), 2)} m/s at most:"
      | tasks |> Enum.map(&"  #{name(&1)}: #{legs(&1)}") |> Enum.dedup() |> times(tasks)
    ] ++
      [
        "It needs #{Format.decimals(room + 1, 1)} by #{Format.decimals(room + 1, 1)} m of flat floor, and someone " <>
          "beside it. Clockwise squares lie to the right of its mark, the others to the left.",
        "Its wheels turn only when you say go, each time; Enter stops it at once."
      ]
  end

  defp times(lines, tasks) do
    squares = div(Enum.count(tasks, &match?({:square, _, _}, &1)), 2)

    lines
    |> Enum.uniq()
    |> Enum.map(&if(&1 =~ "square", do: &1 <> " (#{squares} times)", else: &1))
  end

  @doc "The speed of the courses, in m/s: never above what the robot's file allows."
  @spec speed(Options.t(), Robot.File.t()) :: float()
  def speed(options, file),
    do: min(options.speed, file.limits[:max_linear] || file.profile.max_linear)

  @doc """
  One course as text.

      iex> Tools.Calibrate.Plan.name({:angle, -2 * :math.pi()})
      "360 degrees to the right"
  """
  @spec name(Lab.Calibration.task()) :: String.t()
  def name({:distance, way}), do: "#{Format.decimals(way, 2)} m straight ahead"
  def name({:angle, turn}) when turn > 0, do: "#{degrees(turn)} degrees to the left"
  def name({:angle, turn}), do: "#{degrees(-turn)} degrees to the right"

  def name({:square, direction, side}),
    do: "a square of #{Format.decimals(side, 1)} m, #{Calibration.Model.words(direction)}"

  defp legs(task) do
    Enum.map_join(Drive.legs(task), ", ", fn
      {:go, way} -> "go #{Format.decimals(way, 2)}"
      {:turn, turn} -> "turn #{degrees(turn)}"
    end)
  end

  defp degrees(turn), do: Format.decimals(turn / @degree, 0)
end
