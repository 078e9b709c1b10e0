defmodule Mix.Tasks.Calibrate do
  @shortdoc "Measures a robot's wheels, its ranges, or a colour that it looks for"
  @moduledoc """
  Calibrates a robot's odometry, its sonars and infrareds, and the colours that its camera looks for.

      mix calibrate odometry config/robots/NAME.exs [options]
      mix calibrate ranges config/robots/NAME.exs [options]
      mix calibrate colour SOURCE --box X,Y,WIDTH,HEIGHT --name NAME [options]

  Each with `--help` lists its options, with examples.

  Exit status: 0 if all went well, 1 if the input or a measurement was wrong.
  """
  use Mix.Task
  alias Hal.Options.Suggest

  @words ["odometry", "ranges", "colour"]

  @impl Mix.Task
  def run(arguments),
    do: Hal.Cli.Command.guard("calibrate", fn -> calibrate(arguments) end)

  defp calibrate(arguments) do
    Hal.Cli.Command.update()

    case arguments do
      ["odometry" | rest] ->
        odometry(rest)

      ["ranges" | rest] ->
        ranges(rest)

      [word | rest] when word in ["colour", "color"] ->
        colour(rest)

      [word | _rest] when word in ["--help", "-h", "help"] ->
        IO.puts(@moduledoc)

      [word | _rest] ->
        refuse(
          "expected odometry, ranges or colour, got #{inspect(word)}#{Suggest.hint(word, @words)}"
        )

      [] ->
        refuse("mix calibrate needs a command: mix calibrate odometry, ranges or colour")
    end
  end

  defp odometry(words) do
    case Tools.Calibrate.Options.parse(words) do
      {:ok, options} -> finish(Tools.Calibrate.Odometry.run(options))
      {:error, lines} -> refuse(lines, "mix calibrate odometry --help lists all options")
      :help -> IO.puts(odometry_help())
    end
  end

  defp finish(:ok), do: :ok
  defp finish({:error, lines}), do: refuse(lines)

  @spec refuse(String.t() | [String.t()]) :: no_return()
  @spec refuse(String.t() | [String.t()], String.t() | nil) :: no_return()
  defp refuse(lines, more \\ nil) do
    Hal.Cli.Command.refuse("calibrate", List.wrap(lines) ++ List.wrap(more))
  end

  defp odometry_help do
    """
    Finds what is wrong with a robot's odometry: units per metre and radian, unequal wheels.

        mix calibrate odometry config/robots/NAME.exs [options]
      mix calibrate ranges config/robots/NAME.exs [options]
        mix calibrate odometry --simulate [options]

    The robot drives straight on, turns, and drives squares both ways round (UMBmark, Borenstein and Feng
    1996); before each a person says go, after each he types what he measured. Enter stops it at once.
    What was found is shown as the change of the robot file, and written when he says so.

    #{Hal.Cli.Arguments.help(Tools.Calibrate.Options.table())}

    Examples:

        mix calibrate odometry config/robots/mag1.exs --dry-run
        mix calibrate odometry config/robots/mag1.exs
        mix calibrate odometry config/robots/mag1.exs --squares 0
        mix calibrate odometry config/robots/mag1.exs --distance 5 --measured 5.12 --angle 360 --turned 351 --turned -349
        mix calibrate odometry config/robots/mag1.exs --side 4 --cw -0.31,-0.28 --cw -0.29,-0.30 --ccw 0.10,-0.05 --ccw 0.08,-0.07
        mix calibrate odometry --simulate --seeds 20 --true-base 1.02 --true-ratio 1.01
    """
  end

  defp ranges(words) do
    case Tools.Calibrate.Ranges.parse(words) do
      {:ok, options} -> finish(Tools.Calibrate.Ranges.run(options))
      {:error, lines} -> refuse(lines, "mix calibrate ranges --help lists all options")
      :help -> IO.puts(ranges_help())
    end
  end

  defp ranges_help do
    """
    Finds the conversions of a robot's sonars or infrareds by a flat wall at known distances. The wheels stay disarmed.

        mix calibrate ranges config/robots/NAME.exs [options]

    #{Hal.Cli.Arguments.help(Tools.Calibrate.Ranges.table())}

    Examples:

        mix calibrate ranges config/robots/mag1.exs --at 0.5,1,2
        mix calibrate ranges config/robots/mag1.exs --sensor infrared --number 11
        mix calibrate ranges config/robots/mag1.exs --at 0.5,1 --told 0.54,1.09 --write
    """
  end

  defp colour(words) do
    case Tools.Calibrate.ColourOptions.parse(words) do
      {:ok, options} -> finish(Tools.Calibrate.Colour.run(options))
      {:error, lines} -> refuse(lines, "mix calibrate colour --help lists all options")
      :help -> IO.puts(colour_help())
    end
  end

  defp colour_help do
    """
    Finds the limits of a colour from places in a picture that show it, and tells what they do there.

        mix calibrate colour SOURCE --box X,Y,WIDTH,HEIGHT --name NAME [options]

    SOURCE is a picture or video file, a stream (rtsp://…), a camera (/dev/video0), or sim, a simulated camera.
    Outliers in a box are left out (edges, glare, background in its corners); what is left is widened
    by what a change of light does, as far as nothing else in the picture is taken for the colour.

    #{Hal.Cli.Arguments.help(Tools.Calibrate.ColourOptions.table())}

    Examples:

        mix calibrate colour /dev/video0 --box 140,90,40,60 --name YellowLandmark --picture look.png
        mix calibrate colour photo.jpg --point 160,120 --point 170,140 --name Red --colours config/robots/landmark.txt
        mix calibrate colour tour.avi --frames 5 --point 160,120 --box 120,80,80,80 --name Ball --light 20
        mix calibrate colour sim --box 128,80,20,60 --name YellowLandmark --metres 2 --picture look.png
    """
  end
end
