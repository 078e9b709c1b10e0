defmodule Console.Picture.Floor do
  @moduledoc false
  # Draws the upper part of a run's picture: walls, each robot's path, and where each ended. Pure.
  alias Console.Picture.{MapView, RunTrack, Svg}
  alias Console.Picture.{Colours, Labels}
  alias Hal.Pose

  @aspect 1.25
  @wall "#4A4F57"
  @ink "#22262B"
  @landmark "#F2C200"

  @doc """
  The part of the map worth showing: all of it, or the surroundings of the paths if they fill much
  less of it.
  """
  @spec box(MapView.t(), RunTrack.t()) :: MapView.box()
  def box(ground, track) do
    places = List.flatten(Map.values(track.ways)) ++ track.landmark
    slots = for %{slot: {_x, _y} = slot} <- track.last.robots, do: slot
    around = &MapView.around(ground, places ++ slots, 1.0, &1)
    {left, bottom, right, top} = around.({5.0, 5.0})
    {wide, high} = {right - left, top - bottom}
    # It gets the proportions of the area that it is drawn in, if the map has the room.
    {left, bottom, right, top} =
      box = around.({max(wide, @aspect * high), max(high, wide / @aspect)})

    if (right - left) * (top - bottom) > 0.8 * ground.width * ground.height,
      do: MapView.box(ground),
      else: box
  end

  @doc "The drawing, with `scale` pixels per metre and its upper left corner at 0,0."
  @spec draw(MapView.t(), RunTrack.t(), MapView.box(), float()) :: iodata()
  def draw(ground, track, {left, bottom, right, top} = box, scale) do
    at = fn {x, y} -> {(x - left) * scale, (top - y) * scale} end
    width = (right - left) * scale
    height = (top - bottom) * scale
    colours = colours(track)

    [
      Svg.element(:clipPath, [id: "floor"], Svg.element(:rect, width: width, height: height)),
      Svg.element(:rect, width: width, height: height, fill: "#FBFBF9"),
      Svg.group([clip_path: "url(#floor)"], [
        grid(box, at),
        walls(ground, box, scale),
        landmark_way(track, at),
        Enum.map(track.first.robots, &way(&1, track, colours, at)),
        Enum.map(track.first.robots, &start(&1, colours, at, scale)),
        slots(track.last, at, scale),
        landmark(track.last.landmark, at, scale),
        Enum.map(track.last.robots, &robot(&1, colours, at, scale)),
        Labels.draw(track, at, scale, width)
      ]),
      Svg.element(:rect,
        width: width,
        height: height,
        fill: "none",
        stroke: @wall,
        stroke_width: 1
      ),
      ruler(width, height, scale)
    ]
  end

  @doc "The colour and dash pattern of each robot by name."
  @spec colours(RunTrack.t()) :: %{atom() => {String.t(), String.t() | nil}}
  def colours(track) do
    track.first.robots
    |> Enum.with_index()
    |> Map.new(fn {robot, index} -> {robot.id, Colours.at(index)} end)
  end

  @doc "The symbol of the landmark, for the legend."
  @spec diamond(float(), float(), float()) :: iodata()
  def diamond(x, y, r) do
    Svg.element(:polygon,
      points: Svg.points([{x, y - r}, {x + r, y}, {x, y + r}, {x - r, y}]),
      fill: @landmark,
      stroke: @ink,
      stroke_width: 1.2
    )
  end

  defp grid({left, bottom, right, top}, at) do
    line = fn a, b ->
      {{x1, y1}, {x2, y2}} = {at.(a), at.(b)}
      Svg.element(:line, x1: x1, y1: y1, x2: x2, y2: y2)
    end

    lines =
      for(x <- ceil(left)..floor(right)//1, do: line.({x, bottom}, {x, top})) ++
        for y <- ceil(bottom)..floor(top)//1, do: line.({left, y}, {right, y})

    Svg.group([stroke: "#E9E9E4", stroke_width: 1], lines)
  end

  # Wall cells of one row that touch become one rectangle.
  defp walls(ground, {left, bottom, right, top}, scale) do
    cell = max(0.05, (right - left) / 360)
    columns = ceil((right - left) / cell)

    rows =
      for row <- 0..(ceil((top - bottom) / cell) - 1)//1 do
        y = top - (row + 0.5) * cell

        0..(columns - 1)
        |> Enum.map(&ground.wall?.(left + (&1 + 0.5) * cell, y))
        |> runs()
        |> Enum.map(fn {from, count} ->
          Svg.element(:rect,
            x: from * cell * scale,
            y: row * cell * scale,
            width: count * cell * scale,
            height: cell * scale + 0.3
          )
        end)
      end

    Svg.group([fill: @wall, shape_rendering: "crispEdges"], rows)
  end

  defp runs(row) do
    row
    |> Enum.chunk_by(& &1)
    |> Enum.map_reduce(0, fn chunk, from ->
      {{hd(chunk), from, length(chunk)}, from + length(chunk)}
    end)
    |> elem(0)
    |> Enum.flat_map(fn {wall?, from, count} -> if wall?, do: [{from, count}], else: [] end)
  end

  defp landmark_way(%{landmark: way}, at) when length(way) > 1 do
    first = List.last(way)
    {x, y} = at.(first)

    [
      Svg.element(:polyline,
        points: way |> Enum.map(at) |> Svg.points(),
        fill: "none",
        stroke: "#B38F00",
        stroke_width: 2,
        stroke_dasharray: "2 5",
        stroke_linecap: "round"
      ),
      Svg.element(:polygon,
        points: Svg.points([{x, y - 7}, {x + 7, y}, {x, y + 7}, {x - 7, y}]),
        fill: "#FFFFFF",
        stroke: "#B38F00",
        stroke_width: 1.5
      )
    ]
  end

  defp landmark_way(_track, _at), do: []

  defp way(robot, track, colours, at) do
    {colour, dash} = colours[robot.id]

    Svg.element(:polyline,
      points: track.ways[robot.id] |> Enum.map(at) |> Svg.points(),
      fill: "none",
      stroke: colour,
      stroke_width: 2,
      stroke_opacity: 0.75,
      stroke_linejoin: "round",
      stroke_linecap: "round",
      stroke_dasharray: dash
    )
  end

  defp start(robot, colours, at, scale) do
    {colour, _dash} = colours[robot.id]
    body(robot, at, scale, fill: "#FFFFFF", stroke: colour, stroke_width: 1.5, opacity: 0.9)
  end

  defp robot(%{alive: false} = robot, colours, at, scale) do
    {colour, _dash} = colours[robot.id]
    {x, y} = at.(Pose.point(robot.pose))
    r = 0.7 * Colours.size(robot, scale)
    cross = "M#{-r},#{-r} L#{r},#{r} M#{-r},#{r} L#{r},#{-r}"

    [
      body(robot, at, scale, fill: "#C9CCD1", stroke: colour, stroke_width: 1.5),
      Svg.element(:path,
        d: cross,
        transform: "translate(#{x} #{y})",
        stroke: "#A00000",
        stroke_width: 2.5
      )
    ]
  end

  defp robot(robot, colours, at, scale) do
    {colour, _dash} = colours[robot.id]
    {x, y} = at.(Pose.point(robot.pose))

    crown =
      if robot.leader? do
        Svg.element(:circle,
          cx: x,
          cy: y,
          r: Colours.size(robot, scale) + 4,
          fill: "none",
          stroke: @ink,
          stroke_width: 2
        )
      else
        []
      end

    [crown, body(robot, at, scale, fill: colour, stroke: "#FFFFFF", stroke_width: 1.2)]
  end

  # A disc to scale, with a stroke from its centre to its front.
  defp body(robot, at, scale, look) do
    {x, y} = at.(Pose.point(robot.pose))
    r = Colours.size(robot, scale)
    heading = robot.pose.heading
    nose = if look[:fill] == "#FFFFFF", do: look[:stroke], else: "#FFFFFF"

    [
      Svg.element(:circle, [cx: x, cy: y, r: r] ++ look),
      Svg.element(:line,
        x1: x,
        y1: y,
        x2: x + r * :math.cos(heading),
        y2: y - r * :math.sin(heading),
        stroke: nose,
        stroke_width: max(1.5, r / 5),
        stroke_linecap: "round"
      )
    ]
  end

  defp slots(scene, at, scale) do
    for %{slot: {_x, _y} = slot} = robot <- scene.robots do
      {x, y} = at.(slot)

      Svg.element(:circle,
        cx: x,
        cy: y,
        r: Colours.size(robot, scale) + 2.5,
        fill: "none",
        stroke: @ink,
        stroke_width: 1,
        stroke_dasharray: "3 3"
      )
    end
  end

  defp landmark(nil, _at, _scale), do: []

  defp landmark(place, at, scale) do
    {x, y} = at.(place)
    diamond(x, y, max(0.25 * scale, 7.0))
  end

  defp ruler(width, height, scale) do
    {x, y} = {width - scale - 14, height - 14}
    style = [stroke: @ink, stroke_width: 2]

    [
      Svg.element(:rect,
        x: x - 6,
        y: y - 20,
        width: scale + 12,
        height: 28,
        fill: "#FFFFFF",
        opacity: 0.8
      ),
      Svg.element(:line, [x1: x, y1: y, x2: x + scale, y2: y] ++ style),
      Svg.element(:line, [x1: x, y1: y - 4, x2: x, y2: y + 4] ++ style),
      Svg.element(:line, [x1: x + scale, y1: y - 4, x2: x + scale, y2: y + 4] ++ style),
      Svg.text("1 m", x + scale / 2, y - 6, font_size: 11, text_anchor: "middle", fill: @ink)
    ]
  end
end
