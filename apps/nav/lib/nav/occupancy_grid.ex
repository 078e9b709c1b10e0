defmodule Nav.OccupancyGrid do
  @moduledoc """
  Holds the walls that a robot's sonars have seen: evidence for the cells of a square window of 20 m that follows the robot
  (Moravec and Elfes 1985). Pure.

  An echo raises the cells on its arc and lowers those before it; no echo only lowers. What another robot or a
  known disc explains is no wall, and where a body stands there is none. Evidence goes slowly, so that the errors of
  odometry do not add up for ever. Cells that no reading has reached are free: a robot tries ways that it has not seen.

  The window lies in the frame of the odometry, which never jumps. `grid/1` is what is surely wall, several echoes and not
  one, in the map frame, as it was at most a second ago; a correction of the pose moves it as a whole. Odometry that
  begins again in another frame begins a new window.

  With a floor plan it holds what is not on it: an echo that a wall of the plan explains is none. It begins with the first
  other echo, and ends when none has come for so long that all are forgotten. `grid/1` then lies on the cells of the plan.

  The kernels are in C, with a reference in Elixir (`.Reference`) that gives the same bytes.
  """
  alias Hal.{Odometry, Pose}
  alias Nav.{Grid, OccupancyGrid}
  alias Nav.OccupancyGrid.Cones

  @cell Cones.cell()
  @size 200
  # The window follows when the robot is this far from its middle (metres).
  @follow 2.0
  # Evidence from which on a cell is surely wall.
  @sure 30
  # Evidence goes by 1 in this time (ms).
  @decay_ms 3_000
  # What is surely wall is told this often (ms), if cells changed or the frame moved by this much (metres, radians).
  @told_ms 1_000
  # So near to a known body (metres) were its echoes.
  @beside 0.3
  # With a plan, readings without an echo of something else are taken this often (ms).
  @idle_ms 1_000
  # The strongest evidence is forgotten by then (ms).
  @forgotten_ms 60 * @decay_ms
  @shifted 0.05
  @swung 0.01

  defstruct cells: nil,
            left: 0,
            low: 0,
            frame: nil,
            pose: nil,
            at_ms: nil,
            decayed_ms: nil,
            changes: 0,
            grid: nil,
            told_ms: nil,
            map: nil,
            heard_ms: nil,
            added_ms: nil

  @typedoc """
  `cells` are signed bytes, rows from the lowest y, `nil` before the first reading; `left` and `low` are the cell of the
  odometry's frame that is in the lower left corner; `pose` is where the robot was at the last reading. `changes` counts
  cells that became surely wall, or ceased to be, since `grid` was built, at `told_ms`, with `map` as the pose of the
  odometry's frame in the map's; `heard_ms` is when something was heard last that is not on the plan, `added_ms` when readings were added last.
  """
  @type t :: %__MODULE__{
          cells: binary() | nil,
          left: integer(),
          low: integer(),
          frame: reference() | nil,
          pose: Pose.t() | nil,
          at_ms: integer() | nil,
          decayed_ms: integer() | nil,
          changes: non_neg_integer(),
          grid: Grid.t() | nil,
          told_ms: integer() | nil,
          map: Pose.t() | nil,
          heard_ms: integer() | nil,
          added_ms: integer() | nil
        }

  @type disc :: {x :: float(), y :: float(), radius :: float()}

  @doc "A grid of which nothing is known."
  @spec new() :: t()
  def new, do: %__MODULE__{}

  @doc "What is surely wall, in the map frame; `nil` if nothing is."
  @spec grid(t()) :: Grid.t() | nil
  def grid(%__MODULE__{grid: grid}), do: grid

  @doc """
  Takes the readings of a percept with a pose. `discs` are standing things that are known besides the other robots
  (map frame, metres), `plan` is the floor plan of a robot that has one.
  """
  @spec update(t(), Nav.percept(), [disc()], plan :: Grid.t() | nil) :: t()
  def update(grid, percept, discs, plan \\ nil)

  def update(grid, %{pose: pose, odometry: odometry} = percept, _discs, plan)
      when pose == nil or odometry == nil,
      do: tell(grid, percept, plan)

  def update(grid, percept, discs, plan) do
    grid = if grid.frame == percept.odometry.frame, do: grid, else: begin(percept)
    due? = Cones.due?(percept, grid.at_ms, grid.pose)
    grid = if due?, do: hear(grid, percept, discs, plan), else: grid
    tell(grid, percept, plan)
  end

  defp begin(%{odometry: %Odometry{frame: frame}}), do: %__MODULE__{frame: frame}

  defp hear(grid, percept, discs, nil), do: add(grid, percept, known(percept, discs), 0.0, nil)

  defp hear(grid, %{odometry: %{pose: pose}, at_ms: at_ms} = percept, discs, plan) do
    {known, off} = {known(percept, discs), unsure(percept)}

    cond do
      Cones.surprise?(percept, known, off, plan) ->
        add(%{grid | heard_ms: at_ms}, percept, known, off, plan)

      grid.cells == nil ->
        %{grid | at_ms: at_ms, pose: pose}

      at_ms - grid.heard_ms > @forgotten_ms ->
        %__MODULE__{frame: grid.frame, at_ms: at_ms, pose: pose}

      at_ms - grid.added_ms < @idle_ms ->
        %{grid | at_ms: at_ms, pose: pose}

      true ->
        add(grid, percept, known, off, plan)
    end
  end

  defp unsure(%{uncertainty: %{radius: radius}}), do: radius
  defp unsure(_percept), do: 0.0

  defp add(grid, %{odometry: %{pose: pose}} = percept, known, off, plan) do
    grid = if grid.cells, do: grid, else: middle(grid, pose, percept.at_ms)
    {right, up} = moves = follow(grid, pose)
    {left, low} = {grid.left + right, grid.low + up}
    decay = div(percept.at_ms - grid.decayed_ms, @decay_ms)

    {cells, changes} =
      kernel().add(
        grid.cells,
        @size,
        right,
        up,
        min(decay, 127),
        Cones.pack(percept, pose, known, {left, low}, off, plan),
        :math.tan(percept.profile.sonar_cone / 2),
        Cones.thick(),
        Cones.discs(
          [{pose.x, pose.y, percept.profile.radius} | bodies(known, plan)],
          {left, low}
        ),
        @sure
      )

    # What leaves the window or is too old is not counted.
    lost = if moves != {0, 0} or decay > 0, do: 1, else: 0

    %{
      grid
      | cells: cells,
        left: left,
        low: low,
        pose: pose,
        at_ms: percept.at_ms,
        added_ms: percept.at_ms,
        decayed_ms: grid.decayed_ms + decay * @decay_ms,
        changes: grid.changes + changes + lost
    }
  end

  defp middle(grid, pose, at_ms) do
    %{
      grid
      | cells: <<0::size(@size * @size)-unit(8)>>,
        left: floor(pose.x / @cell) - div(@size, 2),
        low: floor(pose.y / @cell) - div(@size, 2),
        decayed_ms: at_ms
    }
  end

  defp follow(grid, pose), do: {follow(grid.left, pose.x, 0), follow(grid.low, pose.y, 0)}

  defp follow(corner, at, 0) do
    off = floor(at / @cell) - div(@size, 2) - corner
    if abs(off) * @cell > @follow, do: off, else: 0
  end

  # With a plan, what was heard of a body before it was known is forgotten with it.
  defp bodies(known, nil), do: known
  defp bodies(known, _plan), do: for({x, y, radius} <- known, do: {x, y, radius + @beside})

  # Bodies that are known, in the frame of the odometry.
  defp known(percept, discs) do
    robots = for {_id, peer} <- percept.peers, do: {peer.pose.x, peer.pose.y, peer.radius}
    {map, zero} = {map(percept), Pose.new(0, 0)}
    back = Pose.relative(map, zero)

    for {x, y, radius} <- Enum.sort(robots) ++ discs do
      {x, y} = Pose.place(back, {x, y})
      {x, y, radius}
    end
    |> Enum.take(100)
  end

  # The pose of the odometry's frame in the map's.
  defp map(%{pose: pose, odometry: odometry}),
    do: Pose.compose(pose, Pose.relative(odometry.pose, Pose.new(0, 0)))

  # Builds anew what is surely wall, if enough changed.
  defp tell(%{cells: nil} = grid, _percept, _plan), do: grid

  defp tell(grid, %{pose: pose, odometry: odometry}, _plan) when pose == nil or odometry == nil,
    do: grid

  defp tell(grid, percept, plan) do
    due? = grid.told_ms == nil or percept.at_ms - grid.told_ms >= @told_ms
    if due?, do: tell(grid, percept, plan, map(percept)), else: grid
  end

  defp tell(grid, percept, plan, map) do
    if grid.changes > 0 or (grid.grid && Cones.moved?(grid.map, map, @shifted, @swung)) do
      built = build(grid, percept, lattice(plan), map)
      %{grid | grid: built, map: map, told_ms: percept.at_ms, changes: 0}
    else
      grid
    end
  end

  # The width of a cell and the corner of one.
  defp lattice(nil), do: {@cell, {0.0, 0.0}}
  defp lattice(plan), do: {plan.cell, {plan.left, plan.low}}

  # A window of the map about the robot, each of whose cells is looked up.
  defp build(grid, percept, {cell, {x0, y0}}, map) do
    {left, low} = {corner(percept.pose.x - x0, cell), corner(percept.pose.y - y0, cell)}
    first = {x0 + (left + 0.5) * cell, y0 + (low + 0.5) * cell}
    back = Pose.relative(map, Pose.new(0, 0))
    {x, y} = back |> Pose.place(first) |> Cones.in_cells({grid.left, grid.low})
    scale = cell / @cell
    at = {x, y, scale * :math.cos(back.heading), scale * :math.sin(back.heading)}

    case kernel().walls(grid.cells, @size, at, @sure) do
      {_walls, 0} ->
        nil

      {walls, _count} ->
        Grid.new(walls, {@size, @size}, cell, {x0 + left * cell, y0 + low * cell}, closed?: false)
    end
  end

  defp corner(at, cell), do: floor(at / cell) - div(@size, 2)

  @doc false
  @spec kernel() :: module()
  def kernel,
    do:
      if(OccupancyGrid.Native.loaded?(), do: OccupancyGrid.Native, else: OccupancyGrid.Reference)
end
