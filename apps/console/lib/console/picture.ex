defmodule Console.Picture do
  @moduledoc """
  Draws a run as one picture (SVG): the floor with each robot's path, how it stood at the end and why, a legend, and below it
  the formation error over time, if there is a landmark or there was a formation. Pure; no fonts or files are needed to show it.
  """
  alias Console.Cli.Format
  alias Console.Picture.{Floor, Floorplan, Legend, Plot, RunTrack, Svg}

  @width 1180
  @margin 24
  @top 68
  @legend 336
  @floor_width @width - 3 * @margin - @legend
  @floor_height 640
  @plot_height 190
  @ink "#22262B"

  @doc "The drawing of a track, with a title and a line below it."
  @spec draw(RunTrack.t(), {title :: String.t(), settings :: String.t()}) :: iodata()
  def draw(%RunTrack{} = track, {title, settings}) do
    ground = Floorplan.of(track.first.map)
    {left, bottom, right, top} = box = Floor.box(ground, track)
    scale = min(@floor_width / (right - left), @floor_height / (top - bottom))
    {legend_height, legend} = Legend.draw(ground, track, box)
    floor_height = max((top - bottom) * scale, legend_height)
    plot_y = @top + floor_height + 50
    plot? = track.landmark != [] or track.errors != []
    total = if plot?, do: plot_y + @plot_height + 52, else: plot_y - 16

    Svg.document(@width, total, [
      Svg.text(title, @margin, 34, font_size: 18, font_weight: "bold", fill: @ink),
      Svg.text(settings, @margin, 54, font_size: 13, fill: @ink),
      Svg.group(
        [
          transform:
            "translate(#{@margin + round((@floor_width - (right - left) * scale) / 2)} #{@top})"
        ],
        Floor.draw(ground, track, box, scale)
      ),
      Svg.group([transform: "translate(#{@width - @margin - @legend} #{@top})"], legend),
      if(plot?, do: plot(track, plot_y), else: [])
    ])
  end

  defp plot(track, y) do
    Svg.group(
      [transform: "translate(#{@margin + 52} #{round(y)})"],
      Plot.draw(track, @width - 2.0 * @margin - 56, @plot_height * 1.0)
    )
  end

  @doc """
  A title from the options of a run (`Lab.Trial.Options`), and a line that says what robots knew of the map, and how the world
  was simulated.

      iex> run = %{robots: [:mag1, :mag2], map: "maps/hall", seed: 7, plan: :known, noise: :default, blobs: :direct, loss: 0.1}
      iex> Console.Picture.title(Map.put(run, :grey, :wall))
      {"2 robots in hall, seed 7", "plan known, noise default, blobs direct, loss 0.10"}
  """
  @spec title(map()) :: {title :: String.t(), settings :: String.t()}
  def title(run) do
    settings =
      ["plan #{run.plan}", "noise #{run.noise}", "blobs #{run.blobs}"] ++
        if(run.loss > 0, do: ["loss #{Format.decimals(run.loss, 2)}"], else: []) ++
        if(run.grey == :floor, do: ["grey floor"], else: [])

    count = Format.count(length(run.robots), "robot")
    {"#{count} in #{Path.basename(run.map)}, seed #{run.seed}", Enum.join(settings, ", ")}
  end
end
