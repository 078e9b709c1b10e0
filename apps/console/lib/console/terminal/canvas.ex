defmodule Console.Terminal.Canvas do
  @moduledoc false
  # Draws the map in characters: walls in half blocks, robots as arrows with their names. Pure.
  #
  # A character is assumed to be twice as high as wide, so that a circle on the floor is a circle on
  # the screen. Rows are lists of `{text, style}`; `Console.Terminal.Style` turns styles into
  # colours.
  alias Console.Picture.MapView
  alias Hal.{Pose, RobotName}

  @arrows {"→", "↗", "↑", "↖", "←", "↙", "↓", "↘"}

  # Outside the map everything is wall; this much of it is shown.
  @edge 0.3

  @type cell :: {String.t(), atom()}
  @type floor :: %{
          key: term(),
          origin: Pose.point(),
          scale: float(),
          columns: pos_integer(),
          rows: pos_integer(),
          walls: %{{integer(), integer()} => String.t()}
        }

  @doc """
  The arrow for a heading.

      iex> Enum.map([0.0, 1.57, 3.14, -1.57], &Console.Terminal.Canvas.arrow/1)
      ["→", "↑", "←", "↓"]
  """
  @spec arrow(float()) :: String.t()
  def arrow(heading), do: elem(@arrows, Integer.mod(round(heading / (:math.pi() / 4)), 8))

  @doc """
  The floor for this many characters. It is made again only if the size, the map or the visible
  part has changed, because looking for walls costs more than all the rest.
  """
  @spec floor(floor() | nil, MapView.t(), Sim.Scene.t(), pos_integer(), pos_integer()) :: floor()
  def floor(old, ground, scene, columns, rows) do
    box = part(ground, scene, columns, rows)
    key = {ground.name, box, columns, rows}
    if old != nil and old.key == key, do: old, else: build(ground, box, columns, rows, key)
  end

  @doc "The rows of the map with everything on it."
  @spec draw(floor(), Sim.Scene.t()) :: [[cell()]]
  def draw(floor, scene) do
    cells =
      Map.new(floor.walls, fn {at, text} -> {at, {text, :wall}} end)
      |> put_slots(floor, scene)
      |> put_landmark(floor, scene.landmark)
      |> put_objects(floor, scene)

    bodies =
      scene.robots |> Enum.sort_by(& &1.leader?) |> Enum.reduce(cells, &put_robot(&2, floor, &1))

    cells =
      scene.robots
      |> Enum.sort_by(&(not &1.leader?))
      |> Enum.reduce(bodies, &put_name(&2, floor, &1))

    for row <- 0..(floor.rows - 1)//1,
        do:
          for(
            column <- 0..(floor.columns - 1)//1,
            do: Map.get(cells, {column, row}, {" ", :floor})
          )
  end

  # The whole map, if a robot's length is at least about one character there; else the part with
  # the living robots and the landmark, which moves in steps of 2 m so that it is calm.
  defp part(ground, scene, columns, rows) do
    {left, bottom, right, top} = MapView.box(ground)
    whole = {left - @edge, bottom - @edge, right + @edge, top + @edge}

    if scale(whole, columns, rows) <= 0.6 do
      whole
    else
      places =
        for(%{alive: true} = robot <- scene.robots, do: Pose.point(robot.pose)) ++
          List.wrap(scene.landmark) ++ Enum.map(scene.objects, &Pose.point(&1.pose))

      {left, bottom, right, top} = MapView.around(ground, places, 1.0, {8.0, 8.0})
      {outward(left, -1), outward(bottom, -1), outward(right, 1), outward(top, 1)}
    end
  end

  defp outward(value, side), do: side * 2.0 * ceil(side * value / 2.0)

  defp scale({left, bottom, right, top}, columns, rows),
    do: max((right - left) / columns, (top - bottom) / (2 * rows))

  defp build(ground, {left, bottom, right, top} = box, columns, rows, key) do
    scale = scale(box, columns, rows)
    origin = {(left + right) / 2 - scale * columns / 2, (bottom + top) / 2 + scale * rows}
    {x0, y0} = origin

    walls =
      for row <- 0..(rows - 1)//1, column <- 0..(columns - 1)//1, reduce: %{} do
        walls ->
          x = x0 + column * scale
          upper = wall?(ground, x, y0 - 2 * row * scale, scale)
          lower = wall?(ground, x, y0 - (2 * row + 1) * scale, scale)

          case {upper, lower} do
            {true, true} -> Map.put(walls, {column, row}, "█")
            {true, false} -> Map.put(walls, {column, row}, "▀")
            {false, true} -> Map.put(walls, {column, row}, "▄")
            {false, false} -> walls
          end
      end

    %{key: key, origin: origin, scale: scale, columns: columns, rows: rows, walls: walls}
  end

  # A thin wall must not get lost between two samples, nor the map's edge between two characters.
  defp wall?(ground, x, y, scale) do
    edge = max(@edge, 2 / 3 * scale)

    inside? =
      abs(x + scale / 2) <= ground.width / 2 + edge and
        abs(y - scale / 2) <= ground.height / 2 + edge

    inside? and
      Enum.any?(1..3, fn i ->
        Enum.any?(1..3, fn j ->
          ground.wall?.(x + (i - 0.5) * scale / 3, y - (j - 0.5) * scale / 3)
        end)
      end)
  end

  defp cell(floor, {x, y}) do
    {x0, y0} = floor.origin
    {floor((x - x0) / floor.scale), floor((y0 - y) / (2 * floor.scale))}
  end

  defp put_slots(cells, floor, scene) do
    Enum.reduce(scene.robots, cells, fn
      %{slot: nil}, cells -> cells
      %{slot: slot}, cells -> put(cells, floor, cell(floor, slot), {"∘", :slot})
    end)
  end

  defp put_landmark(cells, _floor, nil), do: cells

  defp put_landmark(cells, floor, place),
    do: put(cells, floor, cell(floor, place), {"◆", :landmark})

  defp put_objects(cells, floor, scene) do
    for %{kind: kind, pose: pose} <- scene.objects, reduce: cells do
      cells ->
        put(
          cells,
          floor,
          cell(floor, Pose.point(pose)),
          {if(kind == :ball, do: "●", else: "■"), :landmark}
        )
    end
  end

  defp put_robot(cells, floor, robot) do
    text = if robot.alive, do: arrow(robot.pose.heading), else: "✗"
    put(cells, floor, cell(floor, Pose.point(robot.pose)), {text, style(robot)})
  end

  # Beside its robot if there is room; its number alone if there is only room for that.
  defp put_name(cells, floor, robot) do
    {column, row} = cell(floor, Pose.point(robot.pose))
    name = Atom.to_string(robot.id)
    short = number(name)
    style = name_style(robot)

    spots = [
      {name, column + 1, row},
      {name, column - String.length(name), row},
      {name, column - 1, row - 1},
      {name, column - 1, row + 1},
      {short, column + 1, row},
      {short, column, row - 1}
    ]

    case Enum.find(spots, &free?(cells, floor, &1)) do
      nil -> cells
      {text, left, row} -> put_text(cells, floor, text, left, row, style)
    end
  end

  defp number(name) do
    case name |> String.replace_prefix(RobotName.kind(name), "") |> String.trim("_") do
      "" -> name
      number -> number
    end
  end

  defp free?(cells, floor, {text, left, row}) do
    row in 0..(floor.rows - 1) and left >= 0 and left + String.length(text) <= floor.columns and
      Enum.all?(left..(left + String.length(text) - 1), &empty?(cells, {&1, row}))
  end

  defp empty?(cells, at), do: match?({_text, :slot}, Map.get(cells, at, {" ", :slot}))

  defp put_text(cells, floor, text, left, row, style) do
    text
    |> String.graphemes()
    |> Enum.with_index(left)
    |> Enum.reduce(cells, fn {char, column}, cells ->
      put(cells, floor, {column, row}, {char, style})
    end)
  end

  defp put(cells, floor, {column, row} = at, cell) do
    if column in 0..(floor.columns - 1) and row in 0..(floor.rows - 1),
      do: Map.put(cells, at, cell),
      else: cells
  end

  defp style(%{alive: false}), do: :dead
  defp style(%{leader?: true}), do: :leader
  defp style(%{slot: nil}), do: :robot
  defp style(_robot), do: :follower

  defp name_style(%{alive: false}), do: :dead
  defp name_style(%{leader?: true}), do: :leader
  defp name_style(_robot), do: :name
end
