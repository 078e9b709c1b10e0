defmodule Sim.Floorplan do
  @moduledoc """
  Holds a floor plan of square cells, wall or free. The origin is at the centre, x right, y up, in metres; everything
  outside the plan is wall. Pure.

  `field` has one byte per cell, rows from the lowest y: the distance to the nearest wall in
  cells, counted as a king moves in chess and at most 255; 0 is wall. Rays and bodies use it to
  jump over free space. `room` is the rectangle where a fleet starts. `grey` is the shade of a picture that was taken for wall
  because it seems to stand for what is unknown, `nil` if none was. `unknown` has one byte per cell, too: 1 is wall only because
  it is not known what is there; `nil` if no cell is.
  """
  alias Nav.Grid
  alias Sim.Stage
  alias Sim.Floorplan.{Cells, Clearance, Image, Landmark, Maps, Places, Starts}

  @enforce_keys [:name, :width, :height, :cell, :field, :room]
  defstruct @enforce_keys ++ [grey: nil, unknown: nil]

  @typedoc "What the grey of a picture is that seems to stand for what is unknown (`Nav.MapFile.Picture.unknown/1`)."
  @type grey :: :wall | :floor

  @type point :: {x :: float(), y :: float()}
  @type rectangle :: {left :: float(), low :: float(), right :: float(), high :: float()}
  @type t :: %__MODULE__{
          name: String.t(),
          width: pos_integer(),
          height: pos_integer(),
          cell: float(),
          field: binary(),
          room: rectangle(),
          grey: byte() | nil,
          unknown: binary() | nil
        }

  @doc """
  A map by its name, with room for a fleet of this size: one of `Sim.Floorplan.Maps`, a bitmap with
  its size in metres, such as `"floor.png:16x12"`, a description as map_server writes it,
  `"floor.yaml"`, or the walls of a world of Stage, `"floor.world"` (`Sim.Stage`). `grey` is for bitmaps: a description says itself what is unknown.

      iex> {:ok, map} = Sim.Floorplan.open("hall", 6)
      iex> Sim.Floorplan.size(map)
      {18.0, 18.0}
      iex> {:error, line} = Sim.Floorplan.open("mars", 6)
      iex> line =~ "map: expected hall, hospital, arena, "
      true
  """
  @spec open(String.t(), pos_integer(), grey()) :: {:ok, t()} | {:error, String.t()}
  def open(name, fleet, grey \\ :wall) when fleet > 0 do
    with fields when is_map(fields) <-
           Maps.draw(name, fleet) || name |> file(grey) |> fields(),
         do: {:ok, struct!(__MODULE__, fields)}
  end

  defp file(name, grey) do
    if name =~ ~r/\.world\z/i,
      do: with({:ok, world} <- Stage.open(name), do: Stage.Plan.fields(name, world)),
      else: Image.open(name, grey)
  end

  defp fields({:ok, fields}), do: fields
  defp fields(error), do: error

  @doc "The walls as robots know them that have the floor plan."
  @spec grid(t()) :: Nav.Grid.t()
  def grid(%__MODULE__{} = map) do
    cells = for <<steps <- map.field>>, into: <<>>, do: if(steps == 0, do: <<1>>, else: <<0>>)
    corner = {-map.width * map.cell / 2, -map.height * map.cell / 2}
    Grid.plan(cells, {map.width, map.height}, map.cell, corner)
  end

  @doc "Width and height in metres."
  @spec size(t()) :: {float(), float()}
  def size(%__MODULE__{} = map), do: Cells.size(map)

  @doc """
  Whether there is a wall at this point.

      iex> {:ok, map} = Sim.Floorplan.open("hall", 6)
      iex> {Sim.Floorplan.wall?(map, {0.0, 0.0}), Sim.Floorplan.wall?(map, {99.0, 0.0})}
      {false, true}
  """
  @spec wall?(t(), point()) :: boolean()
  def wall?(%__MODULE__{} = map, point), do: Clearance.steps(map, point) == 0

  @doc "Whether this point is wall only because it is not known what is there."
  @spec unknown?(t(), point()) :: boolean()
  def unknown?(%__MODULE__{unknown: nil}, _point), do: false

  def unknown?(%__MODULE__{unknown: unknown} = map, point),
    do: :binary.at(unknown, Cells.cell(map, point)) == 1

  @doc """
  Whether a disc of this radius fits here.

      iex> {:ok, map} = Sim.Floorplan.open("hall", 6)
      iex> {Sim.Floorplan.free?(map, {8.5, 0.0}, 0.4), Sim.Floorplan.free?(map, {8.5, 0.0}, 0.6)}
      {true, false}
  """
  @spec free?(t(), point(), number()) :: boolean()
  def free?(%__MODULE__{} = map, point, radius), do: clearance(map, point, radius) >= radius

  @doc """
  Distance from a point to the nearest wall, exact if it is less than `limit`, else at least
  `limit`; 0 inside a wall.

      iex> {:ok, map} = Sim.Floorplan.open("hall", 6)
      iex> Sim.Floorplan.clearance(map, {8.5, 0.0}, 1.0)
      0.5
  """
  @spec clearance(t(), point(), number()) :: float()
  defdelegate clearance(map, point, limit), to: Clearance, as: :of

  @doc "The nearest points of all wall cells closer than `limit`, each with its distance."
  @spec near(t(), point(), number()) :: [{distance :: float(), point()}]
  defdelegate near(map, point, limit), to: Clearance

  @doc """
  Start poses: in the room, at least 1.0 m between centres, 0.7 m from walls, 1.2 m from the
  landmark, with random headings. One for each `{id, radius}`, all determined by the seed.

      iex> {:ok, map} = Sim.Floorplan.open("hall", 2)
      iex> {:ok, [a, b]} = Sim.Floorplan.starts(map, [mag1: 0.2, mag2: 0.2], 1, {0.0, 0.0})
      iex> Hal.Pose.distance(a, b) >= 1.0
      true
  """
  @spec starts(t(), [{atom(), float()}], integer(), point() | nil) ::
          {:ok, [Hal.Pose.t()]} | {:error, String.t()}
  def starts(%__MODULE__{} = map, robots, seed, landmark),
    do: Starts.spread(map, robots, seed, landmark)

  @doc """
  Where the landmark stands and where the robots start. Places that are given are taken: a
  landmark, or `nil` for none. With `:default` the landmark stands in the middle of the map, or where the fleet
  has room (`Sim.Floorplan.Places`). Every robot has a free way to it. The same seed gives the same
  places; the error is one line that says what would fit.

      iex> {:ok, map} = Sim.Floorplan.open("ring", 2)
      iex> {:ok, landmark, [_mag1, _mag2]} = Sim.Floorplan.places(map, [mag1: 0.2, mag2: 0.2], 1, :default)
      iex> Sim.Floorplan.free?(map, landmark, 1.0)
      true
  """
  @spec places(t(), [{atom(), float()}], integer(), point() | :default | nil) ::
          {:ok, point() | nil, [Hal.Pose.t()]} | {:error, String.t()}
  def places(%__MODULE__{} = map, robots, seed, landmark),
    do: Places.choose(map, robots, seed, landmark)

  @doc """
  Whether the landmark, 0.15 m in radius, can stand here.

      iex> {:ok, map} = Sim.Floorplan.open("hall", 6)
      iex> Sim.Floorplan.check_landmark(map, {9.0, 0.0})
      {:error, "the landmark cannot stand at 9.0,0.0 of map hall: there is a wall"}
  """
  @spec check_landmark(t(), point()) :: :ok | {:error, String.t()}
  def check_landmark(%__MODULE__{} = map, place), do: Landmark.check(map, place)
end
