defmodule Console.Picture.Legend do
  @moduledoc false
  # Draws what stands beside a run's floor: what happened, how each robot fared, what the signs mean, and the whole map
  # where the floor shows a part of it. Sections stand below each other, each `{height, drawing}`. Pure.
  alias Console.Cli.Format
  alias Console.Picture.{Account, Floor, Labels, MapView, RunTrack, Svg, Walls}
  alias Hal.Pose

  @stages_shown 14
  @robots_shown 14
  @ink "#22262B"
  @soft "#5B616B"
  # Of the text beside a robot's colour: where it begins, and how many characters fit.
  @text_x 50
  @text_chars 46
  # Pixels that the whole map may take.
  @inset {300.0, 210.0}

  @doc "The legend, with its upper left corner at 0,0, and its height in pixels."
  @spec draw(MapView.t(), RunTrack.t(), MapView.box()) :: {height :: float(), iodata()}
  def draw(ground, track, box) do
    [stages(track), robots(track), signs(ground, track), inset(ground, track, box)]
    |> Enum.reject(&(&1 == nil))
    |> stack(18.0)
  end

  defp stack(sections, gap) do
    {drawn, height} =
      Enum.map_reduce(sections, 0.0, fn {height, drawing}, y ->
        {Svg.group([transform: "translate(0 #{round(y)})"], drawing), y + height + gap}
      end)

    {height, drawn}
  end

  defp stages(track) do
    stages = track.marks |> Enum.reverse() |> Enum.map(&elem(&1, 0))
    shown = Enum.take(stages, @stages_shown)
    rows = length(shown)

    {26.0 + 20 * rows + if(length(stages) > rows, do: 20, else: 0),
     [
       heading("What happened", 12),
       shown |> Enum.with_index(1) |> Enum.map(&stage/1),
       more(length(stages) - rows, 30 + 20 * rows)
     ]}
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

  # Of many the leader and those that need an explanation.
  defp robots(%{last: %{robots: robots}} = track) do
    colours = Floor.colours(track)
    ranked = Enum.sort_by(robots, &{not &1.leader?, not Account.trouble?(&1)})
    kept = for robot <- Enum.take(ranked, @robots_shown), do: robot.id
    shown = Enum.filter(robots, &(&1.id in kept))
    {height, rows} = shown |> Enum.map(&robot(&1, colours, track)) |> stack(5.0)
    hidden = length(robots) - length(shown)

    {24.0 + height + if(hidden > 0, do: 16, else: 0),
     [
       heading("Robots at the end", 12),
       Svg.group([transform: "translate(0 22)"], rows),
       more(hidden, 36 + height)
     ]}
  end

  defp robot(robot, colours, track) do
    {colour, dash} = colours[robot.id]
    doing = Format.rows("#{robot.id}: #{Account.doing(robot)}", @text_chars)
    figures = robot |> Account.figures(track) |> Format.rows(@text_chars)
    lines = rows(doing, @ink) ++ rows(figures, @soft)

    {14.0 * length(lines),
     [
       Svg.element(:line,
         x1: 0,
         y1: 8,
         x2: 30,
         y2: 8,
         stroke: colour,
         stroke_width: 2.5,
         stroke_dasharray: dash
       ),
       Svg.element(:circle, cx: 38, cy: 8, r: 5, fill: colour),
       for {{row, fill}, k} <- Enum.with_index(lines) do
         Svg.text(row, @text_x, 12 + 14 * k, font_size: 11, fill: fill)
       end
     ]}
  end

  defp rows(rows, colour), do: for(row <- rows, row != "", do: {String.trim(row), colour})

  defp object?(%{last: %{objects: objects}}, kind), do: Enum.any?(objects, &(&1.kind == kind))

  defp object(y, kind) do
    corners = for {dx, dy} <- [{-9, -4}, {9, -4}, {9, 4}, {-9, 4}], do: {15.0 + dx, y + dy}

    Floor.object(
      %{kind: kind, pose: Hal.Pose.new(15.0, y), radius: 5.0, corners: corners},
      & &1,
      1.0
    )
  end

  # Those that the drawing has.
  defp signs(ground, %{last: %{robots: robots}} = track) do
    disc = &Svg.element(:circle, [cx: 15, cy: &1] ++ &2)

    rows = [
      {"start", true, &disc.(&1, r: 6, fill: "#FFFFFF", stroke: @soft, stroke_width: 1.5)},
      {"place in the formation", Enum.any?(robots, & &1.slot),
       &Floor.slot(15.0, &1, 7.0, @soft, false)},
      {"place in the formation that lies in a wall",
       Enum.any?(robots, &Floor.walled?(ground, &1)), &Floor.slot(15.0, &1, 7.0, @soft, true)},
      {"leader at the end", Enum.any?(robots, & &1.leader?),
       &[
         disc.(&1, r: 8, fill: "none", stroke: @ink, stroke_width: 2),
         disc.(&1, r: 4.5, fill: @soft)
       ]},
      {"where a robot believes to be", Enum.any?(robots, &Account.off_m/1),
       &Floor.belief(15.0, &1, 6.0, @soft)},
      {"how far off that may be, by its own word", Enum.any?(robots, &Floor.doubt?/1),
       &Floor.doubt(15.0, &1, 9.0, @soft)},
      {"landmark", track.landmark != [], &Floor.diamond(15.0, &1, 7.0)},
      {"ball", object?(track, :ball), &object(&1, :ball)},
      {"box", object?(track, :box), &object(&1, :box)},
      {"not known, taken for wall", ground.unknown? != nil,
       &Svg.element(:rect, x: 8, y: &1 - 7, width: 14, height: 14, fill: Walls.unknown())}
    ]

    drawn = for {name, true, sign} <- rows, do: {name, sign}

    {14.0 + 22 * length(drawn),
     for {{name, sign}, k} <- Enum.with_index(drawn) do
       y = 14.0 + 22 * k
       [sign.(y - 4), Svg.text(name, @text_x, y, font_size: 12, fill: @ink)]
     end}
  end

  defp inset(ground, track, box) do
    {left, bottom, right, top} = whole = MapView.box(ground)

    unless box == whole do
      {most_wide, most_high} = @inset
      scale = min(most_wide / (right - left), most_high / (top - bottom))
      {width, height} = {(right - left) * scale, (top - bottom) * scale}
      at = fn {x, y} -> {(x - left) * scale, (top - y) * scale} end

      {height + 34,
       [
         heading("The whole map, #{metres(right - left)} x #{metres(top - bottom)} m", 12),
         Svg.group([transform: "translate(0 22)"], [
           Svg.element(:rect, width: width, height: height, fill: "#FBFBF9"),
           Walls.draw(ground, whole, scale),
           Svg.element(:rect, width: width, height: height, fill: "none", stroke: Walls.wall()),
           part(box, at),
           Enum.map(track.last.robots, &dot(&1, Floor.colours(track), at)),
           for({_x, _y} = place <- [track.last.landmark], do: mark(at.(place)))
         ])
       ]}
    end
  end

  defp metres(length), do: Format.decimals(length, 0)

  defp part({left, bottom, right, top}, at) do
    {{x1, y1}, {x2, y2}} = {at.({left, top}), at.({right, bottom})}

    Svg.element(:rect,
      x: x1,
      y: y1,
      width: x2 - x1,
      height: y2 - y1,
      fill: "none",
      stroke: "#D55E00",
      stroke_width: 2
    )
  end

  defp dot(robot, colours, at) do
    {x, y} = at.(Pose.point(robot.pose))
    Svg.element(:circle, cx: x, cy: y, r: 2.5, fill: elem(colours[robot.id], 0))
  end

  defp mark({x, y}), do: Floor.diamond(x, y, 4.0)

  defp heading(text, y), do: Svg.text(text, 0, y, font_size: 13, font_weight: "bold", fill: @ink)

  defp more(count, y) when count > 0,
    do: Svg.text("… and #{count} more", @text_x, y, font_size: 12, fill: @soft)

  defp more(_count, _y), do: []
end
