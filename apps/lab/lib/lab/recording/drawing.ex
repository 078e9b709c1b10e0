defmodule Lab.Recording.Drawing do
  @moduledoc "Draws a run's scene for Foxglove and other viewers of its schemas. Pure."
  alias Mcap.Foxglove
  alias Mcap.Foxglove.Scene, as: Bodies
  alias Record.Recording.Drawing
  alias Sim.{Floorplan, Scene}

  @frame "map"
  # A point of a way every 0.2 m, the last 1,000.
  @apart_m 0.2
  @points 1_000
  # Of a floor plan, on its longer side.
  @most_cells 256

  @wall <<80, 80, 80, 255>>
  @floor <<235, 235, 235, 255>>
  @leader {0.90, 0.60, 0.10, 1}
  @living {0.20, 0.45, 0.80, 1}
  @dead {0.50, 0.50, 0.50, 1}
  @landmark {0.95, 0.85, 0.10, 1}
  @ball {0.89, 0.47, 0.08, 1}
  @box {0.12, 0.31, 0.9, 1}
  @layer {0.40, 0.40, 0.45, 0.8}
  @mapped {0.40, 0.40, 0.45, 0.2}
  @slot {0.20, 0.70, 0.30, 0.5}

  @typedoc "Each robot's way."
  @type paths :: %{atom() => Scene.way()}

  @doc "The floor plan, walls dark; a large one in larger cells."
  @spec map(Floorplan.t()) :: iodata()
  def map(%Floorplan{} = map) do
    {width, height} = Floorplan.size(map)
    {columns, _rows, size} = cells(map)
    pixels = ground(map, @wall, @floor)

    fields =
      for {name, offset} <- Enum.with_index(["red", "green", "blue", "alpha"]),
          do: {name, offset, :u8}

    Foxglove.grid(0, @frame, %{
      pose: {{-width / 2, -height / 2}, 0},
      columns: columns,
      cell_size: {size, size},
      row_stride: 4 * columns,
      cell_stride: 4,
      fields: fields,
      data: pixels
    })
  end

  @doc "How a floor plan is drawn: its columns, its rows, and the size of a cell in metres."
  @spec cells(Floorplan.t()) ::
          {columns :: pos_integer(), rows :: pos_integer(), metres :: float()}
  def cells(%Floorplan{} = map) do
    block = block(map)
    {div(map.width - 1, block) + 1, div(map.height - 1, block) + 1, block * map.cell}
  end

  defp block(map), do: div(max(map.width, map.height) - 1, @most_cells) + 1

  @doc "The bytes of its cells, row after row from the corner of the least x and y, of one with a wall and one without."
  @spec ground(Floorplan.t(), wall :: binary(), floor :: binary()) :: binary()
  def ground(%Floorplan{} = map, wall, floor) do
    {columns, rows, _size} = cells(map)
    walls = walls(map, block(map))
    for row <- 0..(rows - 1), into: <<>>, do: row(walls[row], columns, wall, floor)
  end

  defp row(nil, columns, _wall, floor), do: :binary.copy(floor, columns)

  defp row(walls, columns, wall, floor) do
    for column <- 0..(columns - 1),
        into: <<>>,
        do: if(is_map_key(walls, column), do: wall, else: floor)
  end

  # The larger cells that have a wall in them, by row and column: floor plans are mostly floor.
  defp walls(map, block) do
    for {place, 1} <- :binary.matches(map.field, <<0>>), reduce: %{} do
      walls ->
        row = place |> div(map.width) |> div(block)
        column = place |> rem(map.width) |> div(block)
        Map.update(walls, row, %{column => true}, &Map.put(&1, column, true))
    end
  end

  @doc "Where each robot's body is."
  @spec transforms(non_neg_integer(), Scene.t()) :: iodata()
  def transforms(ns, scene) do
    transforms = for robot <- scene.robots, do: {@frame, Atom.to_string(robot.id), robot.pose}
    Foxglove.frame_transforms(ns, transforms)
  end

  @doc "Bodies, the landmark, balls and boxes, the places in the formation, and what the mission draws, all of them each time."
  @spec scene(non_neg_integer(), Scene.t()) :: iodata()
  def scene(ns, scene) do
    entities =
      for(robot <- scene.robots, do: robot(ns, robot)) ++
        for(
          %{slot: {x, y}} = robot <- scene.robots,
          do: entity(ns, "place of #{robot.id}", [Drawing.spot({x, y}, @slot)])
        ) ++
        for({x, y} <- List.wrap(scene.landmark), do: entity(ns, "landmark", pole({x, y}))) ++
        for(object <- scene.objects, do: entity(ns, object.id, object(object))) ++
        for sign <- scene.layer, do: entity(ns, elem(sign, 1), sign(sign))

    Foxglove.scene_update(entities, [Bodies.delete_all(ns)])
  end

  # What the mission draws (`t:Robot.Mission.layer/0`).
  defp sign({:polyline, _name, points}), do: [Bodies.line(points, 0.03, @layer)]

  defp sign({:cells, _name, size, places}),
    do: for({x, y} <- places, do: Bodies.cube({{x, y, 0.0}, 0}, {size, size, 0.01}, @mapped))

  defp sign({:points, _name, points}) do
    for {x, y, label} <- points,
        body <- [Drawing.spot({x, y}, @layer), Bodies.text({{x, y, 0.3}, 0}, label, 0.2, @layer)],
        do: body
  end

  defp entity(ns, id, bodies), do: Bodies.entity(ns, @frame, id, bodies)

  # In its own frame, with which it moves between two scenes.
  defp robot(ns, %{id: id, radius: radius} = robot) do
    bodies = Drawing.body({{0, 0}, 0}, radius, "#{id} #{robot.state}", colour(robot))

    Bodies.entity(ns, Atom.to_string(id), Atom.to_string(id), bodies, frame_locked: true)
  end

  defp colour(%{alive: false}), do: @dead
  defp colour(%{leader?: true}), do: @leader
  defp colour(_robot), do: @living

  defp object(%{kind: :ball, pose: %{x: x, y: y}, size: r}),
    do: [Bodies.cylinder({{x, y, r}, 0}, {2 * r, 2 * r, 2 * r}, @ball)]

  defp object(%{pose: pose, size: {length, width}, height: height}),
    do: [Bodies.cube({{pose.x, pose.y, height / 2}, pose.heading}, {length, width, height}, @box)]

  defp pole({x, y}), do: [Bodies.cylinder({{x, y, 0.5}, 0}, {0.3, 0.3, 1.0}, @landmark)]

  @doc "The ways with where the robots are now."
  @spec note(paths(), Scene.t()) :: paths()
  def note(paths, scene) do
    for {id, way} <- Scene.ways(paths, scene, @apart_m),
        into: %{},
        do: {id, Enum.take(way, @points)}
  end

  @doc "The robots' ways as lines."
  @spec paths(non_neg_integer(), paths()) :: iodata()
  def paths(ns, paths) do
    entities =
      for {id, [_, _ | _] = path} <- Enum.sort(paths) do
        entity(ns, "way of #{id}", [Bodies.line(Enum.reverse(path), 0.03, @living)])
      end

    Foxglove.scene_update(entities)
  end
end
