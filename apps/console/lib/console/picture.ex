defmodule Console.Picture do
  @moduledoc """
  Draws a run as one picture (SVG): the floor with each robot's path, a legend, and below it the formation error over
  time, if there is a landmark or there was a formation. Pure; no fonts or files are needed to show it.
  """
  alias Console.Cli.Format
  alias Console.Picture.{RunTrack, Svg}
  alias Console.Picture.{Floor, Labels, Plot}

  @width 1080
  @margin 24
  @legend 236
  @floor_width @width - 3 * @margin - @legend
  @floor_height 640
  @plot_height 190
  @ink "#22262B"

  @doc "The drawing of a track, with a title."
  @spec draw(RunTrack.t(), String.t()) :: iodata()
  def draw(%RunTrack{} = track, title) do
    ground = Console.Picture.Floorplan.of(track.first.map)
    {left, bottom, right, top} = box = Floor.box(ground, track)
    scale = min(@floor_width / (right - left), @floor_height / (top - bottom))
    height = (top - bottom) * scale
    floor_height = max(height, legend_height(track))
    plot_y = 56 + floor_height + 50
    plot? = track.landmark != [] or track.errors != []
    total = if plot?, do: plot_y + @plot_height + 52, else: plot_y - 16

    [
      ~s(<?xml version="1.0" encoding="UTF-8"?>\n),
      Svg.element(
        :svg,
        [
          xmlns: "http://www.w3.org/2000/svg",
          width: @width,
          height: total,
          viewBox: "0 0 #{@width} #{round(total)}",
          font_family: "DejaVu Sans, Verdana, Helvetica, sans-serif"
        ],
        [
          Svg.element(:rect, width: @width, height: total, fill: "#FFFFFF"),
          Svg.text(title, @margin, 34, font_size: 18, font_weight: "bold", fill: @ink),
          Svg.group(
            [
              transform:
                "translate(#{@margin + round((@floor_width - (right - left) * scale) / 2)} 56)"
            ],
            Floor.draw(ground, track, box, scale)
          ),
          Svg.group(
            [transform: "translate(#{@width - @margin - @legend} 56)"],
            legend(track)
          ),
          if(plot?, do: plot(track, plot_y), else: [])
        ]
      ),
      "\n"
    ]
  end

  defp plot(track, y) do
    Svg.group(
      [transform: "translate(#{@margin + 52} #{round(y)})"],
      Plot.draw(track, @width - 2.0 * @margin - 56, @plot_height * 1.0)
    )
  end

  @doc """
  A title from the options of the run.

      iex> Console.Picture.title(6, "hall", 7)
      "6 robots in hall, seed 7"
  """
  @spec title(non_neg_integer(), String.t(), integer()) :: String.t()
  def title(count, map, seed),
    do: "#{Format.count(count, "robot")} in #{Path.basename(map)}, seed #{seed}"

  @stages_shown 14
  @robots_shown 14

  defp legend(track) do
    stages = track.marks |> Enum.reverse() |> Enum.map(&elem(&1, 0))
    shown = Enum.take(stages, @stages_shown)
    below = 26 + 20 * length(shown) + if(length(stages) > @stages_shown, do: 20, else: 0)

    [
      heading("What happened", 12),
      shown |> Enum.with_index(1) |> Enum.map(&stage/1),
      more(length(stages) - @stages_shown, 30 + 20 * length(shown)),
      Svg.group([transform: "translate(0 #{below + 18})"], robots(track))
    ]
  end

  defp stage({stage, number}) do
    y = 14 + 20 * number

    [
      Labels.badge(number, 9.0, y - 4.0),
      Svg.text(Format.decimals(stage.at_s, 1) <> " s", 66, y,
        font_size: 12,
        text_anchor: "end",
        fill: @ink
      ),
      Svg.text(short(stage), 76, y, font_size: 12, fill: @ink)
    ]
  end

  defp short(%{stage: stage, robot: robot}) when robot != nil and stage != :formed,
    do: "#{words(stage)}: #{robot}"

  defp short(%{stage: stage}), do: words(stage)

  defp words(stage), do: stage |> Atom.to_string() |> String.replace("_", " ")

  defp robots(track) do
    colours = Floor.colours(track)
    shown = Enum.take(track.last.robots, @robots_shown)

    [
      heading("Robots", 12),
      shown |> Enum.with_index(1) |> Enum.map(&robot(&1, colours)),
      more(length(track.last.robots) - @robots_shown, 16 + 20 * (length(shown) + 1)),
      Svg.group(
        [
          transform: "translate(0 #{30 + 20 * min(length(track.last.robots), @robots_shown + 1)})"
        ],
        signs(track)
      )
    ]
  end

  defp robot({robot, number}, colours) do
    {colour, dash} = colours[robot.id]
    y = 14 + 20 * number
    note = if robot.leader?, do: "leads", else: note(robot)

    [
      Svg.element(:line,
        x1: 0,
        y1: y - 4,
        x2: 30,
        y2: y - 4,
        stroke: colour,
        stroke_width: 2.5,
        stroke_dasharray: dash
      ),
      Svg.element(:circle, cx: 38, cy: y - 4, r: 5, fill: colour),
      Svg.text("#{robot.id}", 50, y, font_size: 12, fill: @ink),
      Svg.text(note, 104, y, font_size: 12, fill: "#5B616B")
    ]
  end

  defp note(%{alive: false}), do: "dead"
  defp note(%{slot: nil, state: state}), do: words(state)
  defp note(robot), do: "#{Format.decimals(Sim.Scene.slot_error(robot), 2)} m off its place"

  # Those that the drawing has.
  defp signs(%{last: last, landmark: landmark}) do
    rows = [
      {"start", true,
       &Svg.element(:circle,
         cx: 15,
         cy: &1,
         r: 6,
         fill: "#FFFFFF",
         stroke: "#5B616B",
         stroke_width: 1.5
       )},
      {"place in the formation", Enum.any?(last.robots, & &1.slot),
       &Svg.element(:circle,
         cx: 15,
         cy: &1,
         r: 7,
         fill: "none",
         stroke: @ink,
         stroke_width: 1,
         stroke_dasharray: "3 3"
       )},
      {"leader at the end", Enum.any?(last.robots, & &1.leader?),
       &[
         Svg.element(:circle, cx: 15, cy: &1, r: 8, fill: "none", stroke: @ink, stroke_width: 2),
         Svg.element(:circle, cx: 15, cy: &1, r: 4.5, fill: "#5B616B")
       ]},
      {"landmark", landmark != [], &Floor.diamond(15.0, &1, 7.0)}
    ]

    drawn = for {name, true, sign} <- rows, do: {name, sign}

    for {{name, sign}, k} <- Enum.with_index(drawn) do
      y = 14.0 + 22 * k
      [sign.(y - 4), Svg.text(name, 50, y, font_size: 12, fill: @ink)]
    end
  end

  defp heading(text, y), do: Svg.text(text, 0, y, font_size: 13, font_weight: "bold", fill: @ink)

  defp more(count, y) when count > 0,
    do: Svg.text("… and #{count} more", 50, y, font_size: 12, fill: "#5B616B")

  defp more(_count, _y), do: []

  defp legend_height(track) do
    260.0 + 20 * min(length(track.marks), @stages_shown + 1) +
      20 * min(length(track.last.robots), @robots_shown + 1) - 70
  end
end
