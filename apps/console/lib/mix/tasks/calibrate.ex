defmodule Mix.Tasks.Calibrate do
  @shortdoc "Measures a robot's wheels, or a colour that it looks for"
  @moduledoc """
  Measures what differs from robot to robot, and from room to room.

      mix calibrate odometry config/robots/NAME.exs [options]
      mix calibrate colour SOURCE --box X,Y,WIDTH,HEIGHT --name NAME [options]

  `mix calibrate odometry --help` and `mix calibrate colour --help` list the options, with examples.

  Exit status: 0 all went well, 1 something was wrong with the input, or with what was measured.
  """
  use Mix.Task
  alias Console.Build

  @words ["odometry", "colour"]

  @impl Mix.Task
  def run(arguments) do
    Build.update()

    case arguments do
      ["odometry" | rest] ->
        odometry(rest)

      [word | rest] when word in ["colour", "color"] ->
        colour(rest)

      [word | _rest] when word in ["--help", "-h", "help"] ->
        IO.puts(@moduledoc)

      [word | _rest] ->
        refuse(
          "#{inspect(word)} cannot be calibrated: odometry or colour#{Hal.Suggest.hint(word, @words)}"
        )

      [] ->
        refuse("what? mix calibrate odometry or mix calibrate colour")
    end
  end

  defp odometry(words) do
    case Console.Calibrate.Options.parse(words) do
      {:ok, options} -> finish(Console.Calibrate.Odometry.run(options))
      {:error, lines} -> refuse(lines, "mix calibrate odometry --help lists all options")
      :help -> IO.puts(odometry_help())
    end
  end

  defp finish(:ok), do: :ok
  defp finish({:error, lines}), do: refuse(lines)

  @spec refuse(String.t() | [String.t()]) :: no_return()
  @spec refuse(String.t() | [String.t()], String.t() | nil) :: no_return()
  defp refuse(lines, more \\ nil) do
    for line <- List.wrap(lines) ++ List.wrap(more), do: IO.puts(:stderr, "calibrate: #{line}")
    exit({:shutdown, 1})
  end

  defp odometry_help do
    """
    Finds what is wrong with a robot's odometry: units per metre and radian, unequal wheels.

        mix calibrate odometry config/robots/NAME.exs [options]
        mix calibrate odometry --simulate [options]

    The robot drives straight on, turns, and drives squares both ways round (UMBmark, Borenstein and Feng
    1996); before each a person says go, after each he types what he measured. Enter stops it at once.
    What was found is shown as the change of the robot file, and written when he says so.

    #{Console.Arguments.help(Console.Calibrate.Options.table())}

    Examples:

        mix calibrate odometry config/robots/mag1.exs --dry-run
        mix calibrate odometry config/robots/mag1.exs
        mix calibrate odometry config/robots/mag1.exs --squares 0
        mix calibrate odometry config/robots/mag1.exs --distance 5 --measured 5.12 --angle 360 --turned 351 --turned -349
        mix calibrate odometry config/robots/mag1.exs --side 4 --cw -0.31,-0.28 --cw -0.29,-0.30 --ccw 0.10,-0.05 --ccw 0.08,-0.07
        mix calibrate odometry --simulate --seeds 20 --true-base 1.02 --true-ratio 1.01
    """
  end

  defp colour(_words), do: refuse("not yet")
end
