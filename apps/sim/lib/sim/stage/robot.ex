defmodule Sim.Stage.Robot do
  @moduledoc """
  Reads a robot of a world file: a `position` with its sensors. Pure.

  Its body is values of the keys that a file of a body has (docs/robots.md), which this app does not know as such.
  """
  alias Hal.Pose
  alias Sim.Stage.{Entities, Shape, Values}

  # What Stage has for a sensor that does not say it.
  @range [0.0, 5.0]
  @fov 5.7
  # Degrees of a camera that does not say it.
  @camera_fov 60.0
  # A sensor that sees wider, with more rays, is a lidar.
  @widest_sonar 30.0
  @most_rays_of_sonar 4
  # Of the width; Stage has no wheels.
  @wheel_base 0.8
  # Metres and radians a second, and per second squared, of a robot that does not say it.
  @linear {0.5, 0.5}
  @turn {1.0, 1.0}

  # What cameras, rangers and bodies make of a robot here, and what is said of another value in a file.
  @returns [
    {"obstacle_return", 1.0, "robots are solid"},
    {"ranger_return", 0.5, "rangers see robots"},
    {"blob_return", 1.0, "cameras see robots"}
  ]

  @typedoc """
  `kind` is the name of its definition, `name` its own or `nil`; `at` is where it stands in the file; `mark` is the id that finders
  of marks read on it, or `nil`.
  """
  @type t :: %{
          name: String.t() | nil,
          mark: pos_integer() | nil,
          kind: String.t(),
          at: Entities.at(),
          pose: Pose.t(),
          body: keyword()
        }

  @typedoc "What is left out: where, what, and why."
  @type left_out :: {Entities.at(), what :: String.t(), why :: String.t()}

  @doc "The robot of an entity whose properties are checked, at this place, and what of it is left out."
  @spec read(Entities.entity(), Pose.t()) :: {t(), [left_out()]}
  def read(entity, pose) do
    parts = parts(entity, Pose.new(0.0, 0.0))
    {lidars, sonars} = parts |> Enum.flat_map(&sensors/1) |> Enum.split_with(& &1.lidar?)
    cameras = Enum.filter(parts, fn {part, _pose} -> part.type in ["blobfinder", "camera"] end)
    {values, clamped} = entity |> body(sonars, lidars, cameras, parts) |> clamp(entity.at)

    robot = %{
      name: Values.text(entity, "name"),
      kind: hd(entity.names),
      mark: Values.mark(entity),
      at: entity.at,
      pose: pose,
      body: values
    }

    {robot,
     clamped ++
       returns(entity) ++ alike(sonars) ++ further(lidars, "lidar") ++ single(entity, cameras)}
  end

  @doc "The ids of robots that finders of marks see: whether it has one."
  @spec finder?(Entities.entity()) :: boolean()
  def finder?(entity),
    do: entity.type in ["fiducial", "fiducialfinder"] or Enum.any?(entity.entities, &finder?/1)

  # All that it is made of, each with its pose on the robot.
  defp parts(entity, pose) do
    Enum.flat_map(entity.entities, fn part ->
      on_robot = Pose.compose(pose, Values.pose(part, "pose"))
      [{part, on_robot} | parts(part, on_robot)]
    end)
  end

  defp sensors({%{type: type} = ranger, pose}) when type in ["ranger", "laser"] do
    own =
      if type == "laser",
        do: [sensor(ranger, pose, {[0.0, 8.0], 180.0, 180.0})],
        else: []

    inner =
      for %{type: "sensor"} = part <- ranger.entities,
          do: sensor(part, Pose.compose(pose, Values.pose(part, "pose")), {@range, @fov, 1.0})

    own ++ inner ++ old(ranger, pose)
  end

  defp sensors(_other), do: []

  defp sensor(part, pose, {range, fov, samples}) do
    {[least, most], fov} =
      case Values.numbers(part, "view", nil) do
        [least, most, fov] ->
          {[least, most], fov}

        nil ->
          # One number is the greatest.
          [least, most] = Enum.take([0.0 | Values.numbers(part, "range", range)], -2)

          {[Values.number(part, "range_min", least), Values.number(part, "range_max", most)],
           Values.number(part, "fov", fov)}
      end

    rays = part |> Values.number("samples", samples) |> round()
    lidar? = rays > @most_rays_of_sonar and fov > @widest_sonar
    %{at: part.at, pose: pose, min: least, max: most, fov: fov, rays: rays, lidar?: lidar?}
  end

  # As Stage 2 wrote them.
  defp old(ranger, pose) do
    [least, most, fov] = Values.numbers(ranger, "sview", @range ++ [@fov])

    places =
      for {"spose[" <> index, {at, [x, y, degrees]}} <- ranger.properties,
          do: {String.length(index), index, at, Pose.new(x, y, Values.radians(degrees))}

    places
    |> Enum.sort()
    |> Enum.map(fn {_length, _index, at, place} ->
      %{
        at: at,
        pose: Pose.compose(pose, place),
        min: least,
        max: most,
        fov: fov,
        rays: 1,
        lidar?: false
      }
    end)
  end

  defp body(entity, sonars, lidars, cameras, parts) do
    {length, width, height} = Values.size(entity)
    origin = Values.pose(entity, "origin")

    points = entity |> Shape.drawn() |> Enum.concat()
    far = for {x, y} <- points, do: :math.sqrt(x * x + y * y)

    # Points on a circle draw a round robot; any other may have its corners cut off.
    shape =
      cond do
        length == width and length(far) >= 8 and Enum.min(far) > 0.9 * Enum.max(far) ->
          [radius: max(Enum.max(far), length / 2)]

        points == [] ->
          [length: length, width: width, offset: origin.x]

        true ->
          reach = for {x, y} <- points, do: :math.sqrt((x + origin.x) * (x + origin.x) + y * y)
          least = max(abs(origin.x) + length / 2, width / 2)
          [length: length, width: width, offset: origin.x, radius: max(Enum.max(reach), least)]
      end

    mass = Values.number(entity, "mass", nil)

    shape ++
      [height: height, wheel_base: @wheel_base * width, limits: limits(entity)] ++
      if(mass, do: [mass: mass], else: []) ++
      sonars(sonars) ++ lidar(lidars) ++ bumpers(parts) ++ camera(cameras, height)
  end

  defp limits(entity) do
    {linear, turn} = bounds(entity, "velocity_bounds", {elem(@linear, 0), elem(@turn, 0)})

    {speeding, turning} =
      bounds(entity, "acceleration_bounds", {elem(@linear, 1), elem(@turn, 1)})

    [
      max_linear: linear,
      max_turn: turn,
      max_acceleration: speeding,
      max_turn_acceleration: turning
    ]
  end

  # Least and greatest of x, y, z and the turn, in degrees.
  defp bounds(entity, name, {linear, turn}) do
    case Values.numbers(entity, name, []) do
      [_, linear, _, _, _, _, _, turn] -> {linear, Values.radians(turn)}
      [_, linear | _few] -> {linear, turn}
      [] -> {linear, turn}
    end
  end

  defp sonars([]), do: []

  defp sonars([first | _] = sonars) do
    [
      sonars: Enum.map(sonars, &place(&1.pose)),
      sonar_min: first.min,
      sonar_max: first.max,
      sonar_cone: Values.radians(first.fov)
    ]
  end

  defp lidar([]), do: []

  defp lidar([first | _]) do
    [
      scan: [
        pose: place(first.pose),
        rays: first.rays,
        field_of_view: Values.radians(first.fov),
        min: first.min,
        max: first.max
      ]
    ]
  end

  defp place(%Pose{x: x, y: y, heading: heading}), do: {x, y, heading}

  defp bumpers(parts),
    do:
      if(Enum.any?(parts, fn {part, _} -> part.type == "bumper" end), do: [bumpers: 16], else: [])

  # It is fixed, and looks ahead.
  defp camera([], _height), do: []

  defp camera([{camera, _pose} | _], height) do
    [
      camera: [
        field_of_view: Values.radians(Values.number(camera, "fov", @camera_fov)),
        mount_height: height,
        max_pan: 0.0,
        max_tilt: 0.0
      ]
    ]
  end

  # What a body here can be.
  @within %{
    radius: {0.05, 1.5},
    length: {0.1, 2.0},
    width: {0.1, 2.0},
    offset: {-1.0, 1.0},
    height: {0.05, 2.5},
    wheel_base: {0.05, 2.0},
    mass: {0.1, 1000.0},
    sonar_min: {0.0, 1.0},
    sonar_max: {0.5, 12.0},
    sonar_cone: {0.02, 1.6},
    max_linear: {0.01, 10.0},
    max_turn: {0.01, 10.0},
    max_acceleration: {0.01, 10.0},
    max_turn_acceleration: {0.01, 10.0},
    rays: {4, 4096},
    field_of_view: {0.1, 2 * :math.pi()},
    min: {0.0, 1.0},
    max: {0.5, 60.0},
    mount_height: {0.0, 3.0}
  }

  defp clamp(values, at) do
    Enum.map_reduce(values, [], fn
      {key, inner}, told when key in [:limits, :scan, :camera] ->
        {inner, more} = clamp(inner, at)
        {{key, inner}, told ++ more}

      {key, value}, told ->
        {value, more} = clamped(key, value, @within[key], at)
        {{key, value}, told ++ more}
    end)
  end

  defp clamped(_key, value, nil, _at), do: {value, []}

  defp clamped(_key, value, {least, most}, _at) when value >= least and value <= most,
    do: {value, []}

  defp clamped(key, value, {least, most}, at) do
    new = value |> max(least) |> min(most)
    {new, [{at, "#{key} of #{shown(value)}", "#{shown(new)} is taken"}]}
  end

  defp shown(value) when is_float(value),
    do: :erlang.float_to_binary(value, [:compact, decimals: 3])

  defp shown(value), do: to_string(value)

  defp returns(entity) do
    for {name, least, why} <- @returns,
        value = Values.number(entity, name, 1.0),
        value < least,
        do: {Values.at(entity, name), "#{name} of #{shown(value)} on a robot", why}
  end

  # All sonars of a body here are of one kind.
  defp alike([first | others]) do
    kind = &{&1.min, &1.max, &1.fov}

    for odd <- others, kind.(odd) != kind.(first), uniq: true do
      {odd.at, "a range or field of view of its own",
       "all sonars of a robot have those of the first"}
    end
    |> Enum.take(1)
  end

  defp alike([]), do: []

  defp further([_first, second | _], what),
    do: [{second.at, "a second #{what}", "a robot has one"}]

  defp further(_one, _what), do: []

  defp single(entity, cameras) do
    drive = Values.text(entity, "drive")
    second = Enum.drop(cameras, 1)

    for(
      {camera, _pose} <- Enum.take(second, 1),
      do: {camera.at, "a second camera", "a robot has one"}
    ) ++
      if drive in [nil, "diff"],
        do: [],
        else: [{Values.at(entity, "drive"), "drive #{inspect(drive)}", "it has two wheels"}]
  end
end
