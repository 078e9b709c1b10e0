defmodule Mix.Tasks.Mark do
  @shortdoc "Draws a mark with an id, to be printed"
  @moduledoc """
  Draws a mark with an id (an AprilTag, or a self-similar one), to be printed.

      mix mark ID --svg FILE [options]

  `--help` lists the options.

  Print the file in its own size, not fitted to the page, and measure: a robot takes the distance from the size. The size is the
  side of the square between the outer corners of the border, where black meets white, and not that of the paper; of a
  self-similar mark it is the height of its stripes. The robot's file names the same one (`marks: [size: 0.16]`). Keep the white
  round the mark.

  Examples:

      mix mark 7 --svg mark7.svg
      mix mark 7 --family tagStandard41h12 --size 0.08 --svg mark7.svg
      mix mark 7 --family similar --svg mark7.svg
  """
  use Mix.Task
  alias Hal.Cli.Parse
  alias Vision.Marks

  @impl Mix.Task
  def run(words) do
    Hal.Cli.Command.run("mark", words, {@moduledoc, options()}, fn given, words ->
      given = Map.merge(%{"family" => :tag36h11, "size" => 0.16}, Map.new(given))

      with :ok <- Marks.available(given["family"]),
           {:ok, id} <- id(words),
           {:ok, path} <- path(given),
           {:ok, picture} <- picture(given["family"], id),
           :ok <- write(path, picture, given, id) do
        Mix.shell().info(
          "#{given["family"]} #{id}, #{size(given)} between its corners: #{path} written"
        )
      else
        {:error, line} -> {:error, "mark: #{line}"}
      end
    end)
  end

  defp options do
    families = for family <- Marks.families(), do: {family, family}
    names = Enum.map_join(Marks.families(), ", ", &Atom.to_string/1)

    [
      {"svg", "FILE", &Parse.text/1, "where the drawing is written"},
      {"family", "NAME", &Parse.choice(&1, families), "#{names} (tag36h11)"},
      {"size", "METRES", &Parse.number(&1, 0.01, 10), "the side of its square (0.16)"}
    ]
  end

  defp id([word]) do
    case Integer.parse(word) do
      {id, ""} when id >= 0 -> {:ok, id}
      _other -> {:error, "expected the number of a mark, got #{word}"}
    end
  end

  defp id(_words),
    do: {:error, "expected the number of one mark, as in mix mark 7 --svg mark7.svg"}

  defp path(%{"svg" => path}), do: {:ok, path}
  defp path(_given), do: {:error, "--svg FILE is missing: where the drawing is written"}

  defp picture(family, id) do
    case Marks.picture(family, id) do
      nil -> {:error, "#{family} has no mark #{id}"}
      picture -> {:ok, picture}
    end
  end

  defp write(path, picture, given, id) do
    name = "#{given["family"]} #{id}, #{size(given)}"

    with {:error, reason} <- File.write(path, Marks.Sheet.svg(picture, given["size"], name)),
         do: {:error, "#{path} cannot be written: #{:file.format_error(reason)}"}
  end

  defp size(given), do: "#{Float.round(given["size"] * 1000, 1)} mm"
end
