defmodule Console.Picture.Labels do
  @moduledoc false
  # Places the numbered stages on a run's picture, and beside each robot its name with what it does and why, so that no label
  # hides another. Where there is no room for all words, the name alone stands there; the legend has the words. Pure.
  alias Console.Cli.Format
  alias Console.Picture.{Account, Colours, RunTrack, Svg}
  alias Hal.Pose

  @ink "#22262B"
  @soft "#3F454E"
  @halo [paint_order: "stroke", stroke: "#FFFFFF", stroke_width: 3, stroke_linejoin: "round"]
  # In a crowd the legend and the colours must suffice.
  @most 24
  # Characters of a row, pixels of one of them, and of a row's height.
  @chars 26
  @char 6.4
  @row 13
  # How far from its robot a label may stand, in pixels, besides beside it.
  @rings [0, 24, 56]
  @directions [
    {1.0, 0.0},
    {-1.0, 0.0},
    {0.0, 1.0},
    {0.0, -1.0},
    {0.7, 0.7},
    {-0.7, 0.7},
    {0.7, -0.7},
    {-0.7, -0.7}
  ]

  @typep box :: {left :: float(), top :: float(), wide :: float(), high :: float()}

  @doc "All labels in a field of this size; `at` turns metres into pixels."
  @spec draw(RunTrack.t(), (Pose.point() -> {float(), float()}), float(), {float(), float()}) ::
          iodata()
  def draw(track, at, scale, size) do
    marks = marks(track, at, scale)
    taken = for {_number, {x, y}} <- marks, do: {x - 9, y - 9, 18, 18}

    [
      names(track, at, scale, size, taken),
      for({number, {x, y}} <- marks, do: badge(number, x, y))
    ]
  end

  @doc "The badge of the stage with this number."
  @spec badge(pos_integer(), float(), float()) :: iodata()
  def badge(number, x, y) do
    [
      Svg.element(:circle, cx: x, cy: y, r: 8, fill: @ink, stroke: "#FFFFFF", stroke_width: 1.5),
      Svg.text("#{number}", x, y + 3.6,
        fill: "#FFFFFF",
        font_size: 10,
        font_weight: "bold",
        text_anchor: "middle"
      )
    ]
  end

  # Stages at one place would hide each other, so each stands beside the previous one.
  defp marks(track, at, scale) do
    track.marks
    |> Enum.reverse()
    |> Enum.with_index(1)
    |> Enum.reject(fn {{_stage, place}, _number} -> place == nil end)
    |> Enum.map_reduce([], fn {{_stage, place}, number}, taken ->
      {x, y} = at.(place)
      spot = free_spot({x, y - 0.35 * scale - 10}, taken)
      {{number, spot}, [spot | taken]}
    end)
    |> elem(0)
  end

  defp free_spot({x, y} = spot, taken) do
    if Enum.any?(taken, fn {tx, ty} -> abs(tx - x) < 17 and abs(ty - y) < 17 end),
      do: free_spot({x + 18, y}, taken),
      else: spot
  end

  defp names(%{last: %{robots: robots}}, _at, _scale, _size, _taken)
       when length(robots) > @most,
       do: []

  # Those in trouble get their words first, and the others as far as there is room.
  defp names(%{last: scene} = track, at, scale, {width, height}, taken) do
    # The ruler is in the lower right corner.
    ruler = {width - scale - 20, height - 34, scale + 12, 28}
    bodies = [ruler | obstacles(scene, at, scale) ++ taken]

    scene.robots
    |> Enum.sort_by(&(not Account.trouble?(&1)))
    |> Enum.map_reduce([], fn robot, labels ->
      {spot, rows} = place(robot, track, at, scale, {width, height}, {labels, bodies})
      {{pointer(robot, spot, at, scale), label(robot, spot, rows)}, [spot | labels]}
    end)
    |> elem(0)
    |> Enum.unzip()
    |> Tuple.to_list()
  end

  # `labels` are those that stand already, `bodies` what else should not be hidden.
  defp place(robot, track, at, scale, size, {labels, bodies}) do
    name = ["#{robot.id}"]
    doubt = Account.doubt(robot, RunTrack.since_s(track, robot.id))
    why = rows(Account.doing(robot))

    Enum.find_value([name ++ why ++ rows(doubt), name ++ why], fn rows ->
      free =
        robot |> spots(rows, at, scale, size) |> Enum.find(&(crowd(&1, labels ++ bodies) == 0.0))

      free && {free, rows}
    end) ||
      {robot
       |> spots(name, at, scale, size)
       |> Enum.min_by(&{crowd(&1, labels), crowd(&1, bodies)}), name}
  end

  defp rows(text), do: for(row <- Format.rows(text, @chars), row != "", do: String.trim(row))

  # The boxes where a label may stand: beside its robot in eight directions, and farther off.
  @spec spots(map(), [String.t()], function(), float(), {float(), float()}) :: [box()]
  defp spots(robot, rows, at, scale, {width, height}) do
    {x, y} = at.(Pose.point(robot.pose))
    wide = @char * (rows |> Enum.map(&String.length/1) |> Enum.max())
    high = 1.0 * @row * length(rows)

    all =
      for ring <- @rings, {dx, dy} <- @directions do
        r = Colours.size(robot, scale) + 7 + ring

        {x + r * dx + (sign(dx) - 1) / 2 * wide, y + r * dy + (sign(dy) - 1) / 2 * high, wide,
         high}
      end

    inside =
      for {left, top, _, _} = box <- all,
          left > 2,
          left + wide < width,
          top > 2,
          top + high < height,
          do: box

    if inside == [], do: Enum.take(all, 1), else: inside
  end

  defp sign(d) when d > 0, do: 1
  defp sign(d) when d < 0, do: -1
  defp sign(_zero), do: 0

  defp obstacles(scene, at, scale) do
    bodies =
      for robot <- scene.robots,
          place <- [robot.pose, Account.off_m(robot) && robot.believed],
          place != nil,
          do: {Pose.point(place), Colours.size(robot, scale) + 3}

    slots =
      for %{slot: {_, _} = slot} = robot <- scene.robots, do: {slot, Colours.size(robot, scale)}

    landmark = if scene.landmark, do: [{scene.landmark, max(0.25 * scale, 7.0)}], else: []

    for {place, r} <- bodies ++ slots ++ landmark do
      {x, y} = at.(place)
      {x - r, y - r, 2 * r, 2 * r}
    end
  end

  defp crowd({left, top, wide, high}, taken) do
    taken
    |> Enum.map(fn {l, t, w, h} ->
      max(0.0, min(left + wide, l + w) - max(left, l)) *
        max(0.0, min(top + high, t + h) - max(top, t))
    end)
    |> Enum.sum()
  end

  defp label(robot, {left, top, wide, high}, rows) do
    [name | words] = Enum.with_index(rows)
    middle = left + wide / 2

    [
      Svg.element(:rect,
        x: left,
        y: top,
        width: wide,
        height: high,
        rx: 3,
        fill: "#FFFFFF",
        opacity: 0.75
      ),
      line(name, middle, top, if(robot.leader?, do: "bold", else: "normal"), @ink),
      for(row <- words, do: line(row, middle, top, "normal", @soft))
    ]
  end

  defp line({text, k}, x, top, weight, colour) do
    Svg.text(
      text,
      x,
      top + 10 + @row * k,
      [font_size: 11, font_weight: weight, fill: colour, text_anchor: "middle"] ++ @halo
    )
  end

  # A label that does not stand beside its robot has a line to it.
  defp pointer(robot, {left, top, wide, high}, at, scale) do
    {x, y} = at.(Pose.point(robot.pose))
    {px, py} = {x |> max(left) |> min(left + wide), y |> max(top) |> min(top + high)}

    if Pose.distance({x, y}, {px, py}) > Colours.size(robot, scale) + 12,
      do: Svg.element(:line, x1: x, y1: y, x2: px, y2: py, stroke: @soft, stroke_width: 0.8),
      else: []
  end
end
