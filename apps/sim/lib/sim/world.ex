defmodule Sim.World do
  @moduledoc """
  Models a world of robots, walls, one landmark, and balls and boxes that robots push (`Sim.World.Object`), as a value. Pure: the same calls give the same world.

  `step/2` acts, moves and senses. Every sensor is fresh after every step: all sonars fire at once
  and do not disturb each other. Only a lidar has its own period; it sees all of its turn at the end of it. A body is a disc of the profile's radius; it stops at contact and
  is never inside a wall or another body. The landmark is a yellow pole, 0.15 m in radius and 1 m
  high, and solid, too.

  `collisions` counts new contacts of a robot with a robot (even a dead one) or a wall; a contact
  lasts until the two are more than 1 cm apart; `contacts` are the newest of these, newest first.
  `min_separation` is the least gap between two robots so far, edge to edge, `nil` with fewer than
  two.
  """
  alias Hal.{Options, Pose, Twist}
  alias Sim.{Compute, Floorplan, World}
  alias Sim.World.Body
  alias Sim.Compute.CameraFrustum
  alias Sim.World.{Bodies, Motion, Object, Touch}

  @landmark_height 1.0
  @table [
    map: [{:struct, Floorplan}, required: true],
    robots: [{:check, &is_list/1, "a list of robots"}, required: true],
    landmark: [{:check, &is_tuple/1, "{x, y} in metres"}, default: nil],
    marks: [{:list, {:check, &Keyword.keyword?/1, "[id: 3, pose: pose]"}}, default: []],
    objects: [{:list, {:struct, Object}}, default: []],
    seed: [:integer, default: 0],
    noise: [{:one_of, [:off, :default, :slip]}, default: :default],
    start_ms: [:integer, default: 0]
  ]

  @enforce_keys [:map, :seed, :noise, :at_ms, :order, :robots]
  defstruct @enforce_keys ++
              [
                step: 0,
                landmark: nil,
                marks: [],
                objects: [],
                goal: nil,
                collisions: 0,
                contacts: [],
                min_separation: nil,
                together: MapSet.new()
              ]

  @type id :: atom()

  @typedoc "When a contact began, and whose: each with its place, and its speed in m/s as wanted."
  @type contact ::
          {at_ms :: integer(), [{id(), Pose.point(), float()}], :robots | :wall}
  @type t :: %__MODULE__{
          map: Floorplan.t(),
          seed: integer(),
          noise: Body.noise(),
          at_ms: integer(),
          order: [id()],
          robots: %{id() => Body.t()},
          step: non_neg_integer(),
          landmark: Pose.point() | nil,
          marks: [World.Mark.t()],
          objects: [Object.t()],
          goal: Pose.point() | nil,
          collisions: non_neg_integer(),
          contacts: [contact()],
          min_separation: float() | nil,
          together: MapSet.t(Sim.World.Contact.pair())
        }

  @doc """
  A world. `:robots` are `%{id:, profile:, pose:}` with the true pose, and `odometry:`, the first
  reading of the wheels (0, 0, 0 unless given), `infrared: true` for a robot with such sensors,
  `wheels:` for errors of its odometry (`Sim.World.Body`). `:marks` are printed marks, by the options of
  `Sim.World.Mark.new!/1`; cameras see them. `:objects` are balls and boxes. Wrong options raise `ArgumentError`.
  """
  @spec new!(keyword()) :: t()
  def new!(options) do
    options = Options.check!(options, @table, "world")
    %{map: map, noise: noise} = Map.new(options)
    ids = Enum.map(options[:robots], & &1.id)

    unless ids == Enum.uniq(ids),
      do: raise(ArgumentError, "world option robots names a robot twice")

    Enum.each(options[:robots], &free!(map, &1.id, &1.pose, &1.profile.radius))

    bodies =
      for {robot, index} <- Enum.with_index(options[:robots]),
          do: Body.new(robot, index, options[:seed], noise)

    %__MODULE__{
      map: map,
      seed: options[:seed],
      noise: noise,
      at_ms: options[:start_ms],
      order: ids,
      marks: Enum.map(options[:marks], &World.Mark.new!/1),
      objects: options[:objects],
      robots: Elixir.Map.new(bodies, &{&1.id, &1})
    }
    |> place_landmark(options[:landmark])
    |> sense()
  end

  @doc "Sets the wanted speed of a robot until the next one; a dead robot ignores it."
  @spec drive(t(), id(), Twist.t()) :: t()
  def drive(%__MODULE__{} = world, id, %Twist{} = twist),
    do: update(world, id, &if(&1.alive, do: %{&1 | wanted: twist}, else: &1))

  @doc "Sets where a robot's camera should look: pan to the left, tilt upwards, in radians."
  @spec look(t(), id(), number(), number()) :: t()
  def look(%__MODULE__{} = world, id, pan, tilt),
    do: update(world, id, &if(&1.alive, do: %{&1 | look: {pan * 1.0, tilt * 1.0}}, else: &1))

  @doc "Sets the horizontal field of view of a robot's camera, 0.05 to 3 radians, from now on."
  @spec zoom(t(), id(), number()) :: t()
  def zoom(%__MODULE__{} = world, id, angle),
    do: update(world, id, &%{&1 | field_of_view: angle |> max(0.05) |> min(3.0)})

  @doc "Stops a robot for ever; its body stays where it is."
  @spec kill(t(), id()) :: t()
  def kill(%__MODULE__{} = world, id) do
    still = %{
      alive: false,
      wanted: Twist.zero(),
      ramp: {0.0, 0.0},
      speed: {0.0, 0.0},
      measured: Twist.zero()
    }

    update(world, id, &struct!(&1, still))
  end

  @doc "Lifts a robot to another pose, which must not be in a wall; its odometry does not notice."
  @spec displace(t(), id(), Pose.t()) :: t()
  def displace(%__MODULE__{} = world, id, %Pose{} = pose) do
    body = Elixir.Map.fetch!(world.robots, id)

    free!(world.map, id, pose, body.profile.radius)
    world |> update(id, &%{&1 | pose: pose, speed: {0.0, 0.0}, ramp: {0.0, 0.0}}) |> sense()
  end

  defp free!(map, id, pose, radius) do
    unless Floorplan.free?(map, Pose.point(pose), radius),
      do: raise(ArgumentError, "#{id} cannot stand at #{pose.x},#{pose.y}: there is a wall")
  end

  @doc """
  Lets the landmark glide there at 0.3 m/s, in a straight line. It waits in front of a robot in
  its way, 0.5 m from edge to edge, and stops in front of a wall.
  """
  @spec move_landmark(t(), {number(), number()}) :: t()
  def move_landmark(%__MODULE__{landmark: nil} = world, place), do: place_landmark(world, place)
  def move_landmark(%__MODULE__{} = world, {x, y}), do: %{world | goal: {x * 1.0, y * 1.0}}

  @doc "Puts the landmark there at once, or removes it."
  @spec place_landmark(t(), {number(), number()} | nil) :: t()
  def place_landmark(%__MODULE__{} = world, nil), do: %{world | landmark: nil, goal: nil}

  def place_landmark(%__MODULE__{} = world, {x, y}),
    do: %{world | landmark: {x * 1.0, y * 1.0}, goal: nil}

  @doc "The world `dt_ms` later (1 to 100)."
  @spec step(t(), 1..100) :: t()
  def step(%__MODULE__{} = world, dt_ms \\ 50) when dt_ms in 1..100 do
    world
    |> Motion.glide(dt_ms)
    |> Motion.move(dt_ms)
    |> Elixir.Map.update!(:at_ms, &(&1 + dt_ms))
    |> Elixir.Map.update!(:step, &(&1 + 1))
    |> Touch.touch()
    |> sense()
  end

  @doc "What a robot's devices report now; nothing if it is dead."
  @spec readings(t(), id()) :: [Hal.Drive.reading() | Hal.Ptz.reading() | Hal.Lidar.reading()]
  def readings(%__MODULE__{} = world, id) do
    case Elixir.Map.fetch!(world.robots, id) do
      %Body{alive: false} -> []
      body -> Body.readings(body, world.at_ms)
    end
  end

  @doc "Whether a robot has a camera; one that has none has neither detections nor frames."
  @spec camera?(t(), id()) :: boolean()
  def camera?(%__MODULE__{} = world, id),
    do: Elixir.Map.fetch!(world.robots, id).field_of_view != nil

  @doc "The blobs of a robot's picture by geometry, without painting it."
  @spec blobs(t(), id(), scenery() | nil) :: [Vision.Blob.t()]
  def blobs(%__MODULE__{} = world, id, scenery \\ nil) do
    body = Elixir.Map.fetch!(world.robots, id)
    noise = if world.noise != :off, do: {world.seed, body.index, world.step}
    World.Blobs.see(world.map, CameraFrustum.of(body), others(world, body, scenery), noise)
  end

  @typedoc "Everything upright that is in the world now, once for all cameras."
  @opaque scenery :: {things :: binary(), robots :: binary()}

  @doc "What the cameras of all robots see now, for `detections/3` and `frame/3`."
  @spec scenery(t()) :: scenery()
  def scenery(%__MODULE__{} = world) do
    robots = for id <- world.order, do: pole(world.robots[id])
    {Compute.pack(things(world)), Compute.pack(robots)}
  end

  defp others(world, body, nil), do: poles(world, body.id)

  # A robot does not see itself; what is no robot comes first, as in `poles/2`.
  defp others(world, %{index: index}, {things, robots}) do
    size = div(byte_size(robots), length(world.order))
    before = binary_part(robots, 0, index * size)
    behind = binary_part(robots, (index + 1) * size, byte_size(robots) - (index + 1) * size)
    things <> before <> behind
  end

  @doc "The same with the camera's current direction, as a detector would return it, and the marks that it would read; `nil` in a world without."
  @spec detections(t(), id(), scenery() | nil) :: Vision.Detections.t()
  def detections(%__MODULE__{} = world, id, scenery \\ nil) do
    %Body{pan: pan, tilt: tilt, field_of_view: angle} = Elixir.Map.fetch!(world.robots, id)

    %Vision.Detections{
      at_ms: world.at_ms,
      blobs: blobs(world, id, scenery),
      marks: read(world, id),
      pan: pan,
      tilt: tilt,
      field_of_view: angle
    }
  end

  defp read(%{marks: []}, _id), do: nil

  defp read(world, id) do
    body = Elixir.Map.fetch!(world.robots, id)
    sight = CameraFrustum.of(body)
    taken = Elixir.Map.take(body, [:pan, :tilt, :field_of_view])

    frame =
      Elixir.Map.merge(taken, %{at_ms: world.at_ms, width: sight.width, height: sight.height})

    noise = if world.noise != :off, do: {world.seed, body.index, world.step}
    World.MarkReadings.see(world.map, sight, poles(world, id), marks(world, id), frame, noise)
  end

  @doc "The picture of a robot's camera, in its current direction."
  @spec frame(t(), id(), scenery() | nil) :: Hal.Frame.t()
  def frame(%__MODULE__{} = world, id, scenery \\ nil) do
    body = Elixir.Map.fetch!(world.robots, id)
    sight = CameraFrustum.of(body)
    noise = if world.noise != :off, do: {world.seed, world.step, body.index}
    packed = for mark <- marks(world, id), do: mark.packed

    %Hal.Frame{
      format: :i420,
      width: sight.width,
      height: sight.height,
      bytes: Compute.paint(world.map, sight, others(world, body, scenery), packed, noise),
      at_ms: world.at_ms,
      pan: body.pan,
      tilt: body.tilt,
      field_of_view: body.field_of_view
    }
  end

  @doc "The colours of the landmark, `YellowLandmark`, of robots, `RedRobot`, of balls, `OrangeBall`, and of boxes, `BlueBox`."
  @spec colours() :: Vision.Colours.t()
  defdelegate colours, to: Sim.Compute.Palette

  @doc "The true pose of a robot."
  @spec truth(t(), id()) :: Pose.t()
  def truth(%__MODULE__{} = world, id), do: Elixir.Map.fetch!(world.robots, id).pose

  @doc "Whether a robot is alive."
  @spec alive?(t(), id()) :: boolean()
  def alive?(%__MODULE__{} = world, id), do: Elixir.Map.fetch!(world.robots, id).alive

  # As they hang now; a robot does not see its own.
  defp marks(world, id) do
    where = fn robot ->
      %{pose: pose, profile: profile} = Elixir.Map.fetch!(world.robots, robot)
      {pose, profile.radius}
    end

    for mark <- world.marks, mark.robot != id, do: World.Mark.borne(mark, where)
  end

  # Everything upright that robot `id` can see.
  defp poles(%__MODULE__{} = world, id) do
    robots = for other <- world.order, other != id, do: pole(world.robots[other])
    things(world) ++ robots
  end

  defp pole(%Body{pose: pose, profile: profile}),
    do: {pose.x, pose.y, profile.radius, profile.height, :robot}

  defp things(world), do: landmark_pole(world) ++ Enum.map(world.objects, &Object.pole/1)

  defp landmark_pole(%{landmark: nil}), do: []

  defp landmark_pole(%{landmark: {x, y}}),
    do: [{x, y, Bodies.landmark_radius(), @landmark_height, :landmark}]

  defp update(world, id, change),
    do: %{world | robots: Elixir.Map.update!(world.robots, id, change)}

  defp sense(world) do
    bodies = Bodies.all(world)
    discs = Enum.map(bodies, &Bodies.disc/1) ++ Bodies.pole(world)
    living = Enum.filter(bodies, & &1.alive)

    world
    |> put_ranges(:sonar, living, discs, world.step, &{&1.sonar_min, &1.sonar_max})
    |> scan(living, discs)
    |> put_ranges(
      :ir,
      Enum.filter(living, &(&1.infrared != <<>>)),
      discs,
      -world.step - 1,
      &{0.0, &1.ir_max}
    )
  end

  # A lidar whose turn ends now.
  defp scan(world, living, discs) do
    case Enum.filter(living, &Body.scans?(&1, world.at_ms)) do
      [] ->
        world

      bodies ->
        noise = if world.noise != :off, do: {world.seed, world.step, 0}
        lidars = Enum.map(bodies, &Body.lidar/1)

        bodies
        |> Enum.zip(Compute.scan(world.map, discs, lidars, noise))
        |> Enum.reduce(world, fn {body, ranges}, world ->
          update(world, body.id, &Body.scanned(&1, ranges, world.at_ms))
        end)
    end
  end

  # Different kinds of sensors have different draws.
  defp put_ranges(world, _sense, [], _discs, _draw, _limits), do: world

  defp put_ranges(world, sense, bodies, discs, draw, limits) do
    rings =
      for %Body{pose: pose} = body <- bodies do
        {c, s} = Sim.Trig.cos_sin(pose.heading)
        {least, most} = limits.(body.profile)
        geometry = if sense == :ir, do: body.infrared, else: body.geometry
        {body.index, pose.x, pose.y, c, s, least * 1.0, most * 1.0, geometry}
      end

    noise = if world.noise != :off, do: {world.seed, draw, 0}

    bodies
    |> Enum.zip(Compute.sonar(world.map, discs, rings, noise))
    |> Enum.reduce(world, fn {body, ranges}, world ->
      update(world, body.id, &Elixir.Map.put(&1, sense, ranges))
    end)
  end
end
