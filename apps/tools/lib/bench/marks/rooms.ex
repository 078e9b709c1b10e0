defmodule Bench.Marks.Rooms do
  @moduledoc """
  Makes pictures of simulated rooms for `mix bench marks`: with nothing to find, with squares that look like marks and are none,
  and with one mark. Pure.
  """
  alias Hal.{Pose, Profile}
  alias Sim.{Floorplan, World}
  alias Vision.Marks
  alias Vision.Marks.Picture

  @size 0.2
  # Squares of other codes in a picture, and how many cells wide those are.
  @squares 8
  @cells 8

  @typedoc "A mark that hangs before the camera: what it is, and where by the words of `Vision.Mark`."
  @type hung :: %{id: non_neg_integer(), range: float(), bearing: float(), yaw: float()}

  @doc "The side of the marks in metres."
  @spec size() :: float()
  def size, do: @size

  @doc "A world with a map and one robot, whose camera takes the pictures."
  @spec world(String.t(), integer()) :: World.t()
  def world(map, seed) do
    {:ok, map} = Floorplan.open(map, 4)
    {:ok, _none, [start]} = Floorplan.places(map, [mag1: 0.3], seed, nil)
    robots = [%{id: :mag1, profile: Profile.magellan(), pose: start}]
    World.new!(map: map, robots: robots, seed: seed)
  end

  @doc "The world with the robot somewhere else, looking anywhere, and nothing to find."
  @spec empty(World.t(), :rand.state()) :: {World.t(), :rand.state()}
  def empty(world, random) do
    {[x, y, heading], random} = draws(random, 3)
    {wide, high} = {world.map.width * world.map.cell, world.map.height * world.map.cell}
    pose = Pose.new((x - 0.5) * wide, (y - 0.5) * high, 2 * :math.pi() * heading)

    if Floorplan.free?(world.map, Pose.point(pose), 0.3),
      do: {World.displace(%{world | step: world.step + 1, marks: []}, :mag1, pose), random},
      else: empty(world, random)
  end

  @doc "The same with squares in sight that have the border of a mark, and codes of chance."
  @spec cluttered(World.t(), :rand.state()) :: {World.t(), :rand.state()}
  def cluttered(world, random) do
    {world, random} = empty(world, random)

    {squares, random} =
      Enum.map_reduce(1..@squares, random, fn _n, random ->
        {code, random} = :rand.bytes_s(@cells * @cells, random)

        bits =
          for {byte, n} <- Enum.with_index(:binary.bin_to_list(code)), into: <<>> do
            {row, column} = {div(n, @cells), rem(n, @cells)}
            inside? = row in 1..(@cells - 2) and column in 1..(@cells - 2)
            <<if(inside?, do: rem(byte, 2), else: 0)>>
          end

        {mark, _hung, random} = hang(world, 0, Picture.square({@cells, @cells, bits}), random)
        {mark, random}
      end)

    {%{world | marks: squares}, random}
  end

  @doc "The same with one mark of the family in sight."
  @spec marked(World.t(), Vision.Mark.family(), :rand.state()) ::
          {World.t(), hung(), :rand.state()}
  def marked(world, family, random) do
    {world, random} = empty(world, random)
    {id, random} = :rand.uniform_s(Marks.ids(family), random)
    {mark, hung, random} = hang(world, id - 1, Marks.picture(family, id - 1), random)
    {%{world | marks: [mark]}, hung, random}
  end

  # 0.5 to 3.5 m away, within 20 degrees of where the camera looks, turned by up to 60 degrees, at the height of its eye or 0.3 m more or less.
  defp hang(world, id, picture, random) do
    {[range, bearing, yaw, up], random} = draws(random, 4)
    {range, bearing} = {0.5 + 3 * range, (2 * bearing - 1) * 0.35}
    yaw = bearing + (2 * yaw - 1) * 1.05
    %Pose{heading: heading} = pose = World.truth(world, :mag1)
    {x, y} = Pose.place(pose, {range * :math.cos(bearing), range * :math.sin(bearing)})
    eye = world.robots.mag1.profile.camera.mount_height
    faces = Pose.new(x, y, Pose.wrap(heading + yaw + :math.pi()))
    height = eye + (2 * up - 1) * 0.3
    mark = World.Mark.painted!([id: id, size: @size, pose: faces, height: height], picture)
    {mark, %{id: id, range: range, bearing: bearing, yaw: yaw}, random}
  end

  defp draws(random, count),
    do: Enum.map_reduce(1..count, random, fn _n, random -> :rand.uniform_s(random) end)
end
