defmodule Console.Picture.Floor do
  @moduledoc false
  # Draws the upper part of a run's picture: walls, each robot's path, where each ended, and where it believes to have ended.
  # Pure.
  alias Console.Picture.{Account, Colours, Labels, MapView, MissionLayer, RunTrack, Svg, Walls}
  alias Hal.Pose

  @aspect 1.25
  @ink "#22262B"
  @landmark "#F2C200"
  @wrong "#C00000"
  # A slot is looked at in so many directions.
  @looks 8

  @doc """
  The part of the map worth showing: all of it, or the surroundings of the paths if they fill much
  less of it.
  """
  @spec box(MapView.t(), RunTrack.t()) :: MapView.box()
  def box(ground, track) do
    places = List.flatten(Map.values(track.ways)) ++ track.landmark
    slots = for %{slot: {_x, _y} = slot} <- track.last.robots, do: slot
    believed = for robot <- astray(track.last), do: Pose.point(robot.believed)
    around = &MapView.around(ground, places ++ slots ++ believed, 1.0, &1)
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
        Walls.draw(ground, box, scale),
        Enum.map(track.last.layer, &MissionLayer.draw(&1, at)),
        landmark_way(track, at),
        Enum.map(track.first.robots, &way(&1, track, colours, at)),
        Enum.map(track.first.robots, &start(&1, colours, at, scale)),
        slots(ground, track.last, colours, at, scale),
        landmark(track.last.landmark, at, scale),
        Enum.map(track.last.objects, &object(&1, at, scale)),
        Enum.map(track.last.robots, &uncertainty(&1, colours, at, scale)),
        track.last |> astray() |> Enum.map(&believed(&1, colours, at, scale)),
        Enum.map(track.last.robots, &robot(&1, colours, at, scale)),
        Labels.draw(track, at, scale, {width, height})
      ]),
      Svg.element(:rect,
        width: width,
        height: height,
        fill: "none",
        stroke: Walls.wall(),
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

    [
      body(robot, at, scale, fill: "#C9CCD1", stroke: colour, stroke_width: 1.5),
      cross(x, y, 0.7 * Colours.size(robot, scale), @wrong, 2.5)
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

  @doc "A disc or a box to scale, with a stroke from the middle between its wheels to its front; `at` gives the pixels of its place."
  @spec body(Sim.Scene.robot(), (Pose.point() -> {float(), float()}), float(), keyword()) ::
          iodata()
  def body(robot, at, scale, look) do
    {x, y} = at.(Pose.point(robot.pose))
    r = Colours.size(robot, scale)
    heading = robot.pose.heading
    nose = if look[:fill] == "#FFFFFF", do: look[:stroke], else: "#FFFFFF"

    [
      outline(robot[:corners] || [], {x, y}, r, robot, look),
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

  defp outline([], {x, y}, r, _round, look),
    do: Svg.element(:circle, [cx: x, cy: y, r: r] ++ look)

  defp outline(corners, {x, y}, r, robot, look) do
    scale = r / robot.radius
    {c, s} = {:math.cos(robot.pose.heading), :math.sin(robot.pose.heading)}

    places =
      for {ahead, left} <- corners,
          do: {x + scale * (ahead * c - left * s), y - scale * (ahead * s + left * c)}

    Svg.element(:polygon, [points: Svg.points(places)] ++ look)
  end

  defp slots(ground, scene, colours, at, scale) do
    for %{slot: {_x, _y} = slot} = robot <- scene.robots do
      {x, y} = at.(slot)
      {colour, _dash} = colours[robot.id]
      slot(x, y, Colours.size(robot, scale) + 2.5, colour, walled?(ground, robot))
    end
  end

  @doc "A place in the formation in the colour of its robot, marked where it lies in a wall; all in pixels."
  @spec slot(float(), float(), float(), String.t(), walled? :: boolean()) :: iodata()
  def slot(x, y, r, colour, walled?) do
    look = [fill: "none", stroke: colour, stroke_width: 1.5, stroke_dasharray: "3 3"]

    [
      Svg.element(:circle, [cx: x, cy: y, r: r] ++ look),
      if(walled?, do: cross(x, y, 0.6 * r, @wrong, 2.5), else: [])
    ]
  end

  @doc "Whether the place of a robot lies so that its body would be in a wall there, or in what is not known."
  @spec walled?(MapView.t(), Sim.Scene.robot()) :: boolean()
  def walled?(_ground, %{slot: nil}), do: false

  def walled?(ground, %{slot: {x, y}, radius: radius}) do
    around =
      for k <- 1..@looks, angle = 2 * :math.pi() * k / @looks do
        {x + radius * :math.cos(angle), y + radius * :math.sin(angle)}
      end

    Enum.any?([{x, y} | around], fn {x, y} -> ground.wall?.(x, y) end)
  end

  defp astray(scene), do: Enum.filter(scene.robots, &Account.off_m/1)

  # A line from where the robot is to where it believes to be.
  defp believed(robot, colours, at, scale) do
    {colour, _dash} = colours[robot.id]
    {{x1, y1}, {x2, y2}} = {at.(Pose.point(robot.pose)), at.(Pose.point(robot.believed))}

    [
      Svg.element(:line, x1: x1, y1: y1, x2: x2, y2: y2, stroke: colour, stroke_width: 1.2),
      belief(x2, y2, Colours.size(robot, scale), colour)
    ]
  end

  @doc "The sign of where a robot believes to be, in pixels."
  @spec belief(float(), float(), float(), String.t()) :: iodata()
  def belief(x, y, r, colour) do
    [
      Svg.element(:circle, cx: x, cy: y, r: r, fill: "none", stroke: colour, stroke_width: 1.5),
      cross(x, y, 0.7 * r, colour, 1.5)
    ]
  end

  # It is within this circle, as it believes.
  defp uncertainty(robot, colours, at, scale) do
    if doubt?(robot) do
      {x, y} = at.(Pose.point(robot[:believed] || robot.pose))
      doubt(x, y, robot.uncertainty * scale, elem(colours[robot.id], 0))
    else
      []
    end
  end

  @doc "Whether a robot may be farther off than it is wide, by its own word."
  @spec doubt?(Sim.Scene.robot()) :: boolean()
  def doubt?(robot),
    do: robot.alive and robot.uncertainty != nil and robot.uncertainty > robot.radius

  @doc "The circle within which a robot believes to be, in pixels."
  @spec doubt(float(), float(), float(), String.t()) :: iodata()
  def doubt(x, y, r, colour) do
    Svg.element(:circle,
      cx: x,
      cy: y,
      r: r,
      fill: "none",
      stroke: colour,
      stroke_width: 1.5,
      stroke_dasharray: "2 4"
    )
  end

  defp cross(x, y, r, colour, width) do
    Svg.element(:path,
      d: "M#{-r},#{-r} L#{r},#{r} M#{-r},#{r} L#{r},#{-r}",
      transform: "translate(#{x} #{y})",
      stroke: colour,
      stroke_width: width
    )
  end

  @doc "A ball or a box, to scale; `at` gives the pixels of a place."
  @spec object(Sim.Scene.thing(), (Pose.point() -> {float(), float()}), float()) :: iodata()
  def object(%{kind: :ball, pose: pose, radius: radius}, at, scale) do
    {x, y} = at.(Pose.point(pose))
    Svg.element(:circle, [cx: x, cy: y, r: max(radius * scale, 4.0)] ++ object_look("#E4781E"))
  end

  def object(%{kind: :box, corners: corners}, at, _scale),
    do:
      Svg.element(
        :polygon,
        [points: corners |> Enum.map(at) |> Svg.points()] ++ object_look("#1E50E6")
      )

  defp object_look(fill), do: [fill: fill, stroke: @ink, stroke_width: 1]

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
