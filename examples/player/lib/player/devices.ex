defmodule Player.Devices do
  @moduledoc """
  Says which of Player's devices a robot has, and what they answer when they are asked for what they do not say by themselves. Pure.

  | device | of robots with |
  |---|---|
  | `position2d:0`, `power:0`, `localize:0`, `speech:0`, `simulation:0`, `map:0` | all |
  | `sonar:0`, `ranger:0` | sonars |
  | `ir:0`, `ranger:1` | infrareds that its base reports |
  | `bumper:0` | bumpers |
  | `laser:0`, `ranger:2` | a lidar |
  | `ptz:0`, `blobfinder:0`, `fiducial:0` | a camera |
  | `camera:0` | a camera whose pictures can be looked at here |

  Poses are in the robot's own frame, whose origin is the middle between its wheels.
  """
  alias Hal.{Pose, Profile}
  alias Lab.Recording.Drawing
  alias Player.{Source, Wire}
  alias Sim.{Floorplan, Scene}

  # What Player calls a driver.
  @driver "convoy"

  @always [
    {:position2d, 0},
    {:power, 0},
    {:localize, 0},
    {:speech, 0},
    {:simulation, 0},
    {:map, 0}
  ]

  @doc "The name of the driver of each device."
  @spec driver() :: String.t()
  def driver, do: @driver

  @doc """
  The devices of a robot.

      iex> body = %{profile: nil, sonars: [Hal.Pose.new(0.2, 0)], pictures?: false}
      iex> Player.Devices.of(body) -- Player.Devices.of(%{body | sonars: []})
      [{:sonar, 0}, {:ranger, 0}]
  """
  @spec of(Source.body()) :: [Wire.device()]
  def of(%{profile: profile, sonars: sonars, pictures?: pictures?}) do
    @always ++
      if(sonars == [], do: [], else: [{:sonar, 0}, {:ranger, 0}]) ++
      of_profile(profile) ++ if(pictures?, do: [{:camera, 0}], else: [])
  end

  defp of_profile(nil), do: []

  defp of_profile(profile) do
    if(profile.irs == [], do: [], else: [{:ir, 0}, {:ranger, 1}]) ++
      if(profile.bumpers == 0, do: [], else: [{:bumper, 0}]) ++
      if(profile.scan == nil, do: [], else: [{:laser, 0}, {:ranger, 2}]) ++
      if(profile.camera == nil, do: [], else: [{:ptz, 0}, {:blobfinder, 0}, {:fiducial, 0}])
  end

  @doc "What a device answers to a request for its geometry or its settings; `:error` for another request."
  @spec answer(Wire.device(), subtype :: non_neg_integer(), Source.body()) ::
          {:ok, map()} | :error
  def answer({:position2d, 0}, 1, body), do: {:ok, geometry(body.profile)}
  def answer({:sonar, 0}, 1, body), do: {:ok, %{poses: Enum.map(body.sonars, &pose/1)}}
  def answer({:ir, 0}, 1, body), do: {:ok, %{poses: Enum.map(body.profile.irs, &pose/1)}}
  def answer({:bumper, 0}, 1, body), do: {:ok, %{bumpers: bumpers(body.profile)}}
  def answer({:ptz, 0}, 4, body), do: {:ok, camera(body.profile)}
  def answer({:ptz, 0}, 5, _body), do: {:ok, %{status: 0}}
  # Marks differ in size: not known.
  def answer({:fiducial, 0}, 1, body),
    do: {:ok, Map.put(camera(body.profile), :mark, {0.0, 0.0})}

  def answer({:laser, 0}, 1, body), do: {:ok, at(body.profile.scan.pose)}

  def answer({:laser, 0}, 3, %{profile: %{scan: scan}}) do
    {least, most} = span(scan)

    {:ok,
     %{
       min_angle: least,
       max_angle: most,
       resolution: step(scan),
       max_range: scan.max,
       range_res: 0.001,
       intensity: 0,
       frequency: 1 / scan.period
     }}
  end

  def answer({:ranger, which}, 1, body) do
    {base, poses} = elements(which, body)
    sizes = List.duplicate({0.0, 0.0, 0.0}, length(poses))
    {:ok, base |> at() |> Map.merge(%{poses: Enum.map(poses, &pose/1), sizes: sizes})}
  end

  def answer({:ranger, 2}, 5, %{profile: %{scan: scan}}) do
    {least, most} = span(scan)

    {:ok,
     %{
       min_angle: least,
       max_angle: most,
       angular_res: step(scan),
       min_range: scan.min,
       max_range: scan.max,
       range_res: 0.001,
       frequency: 1 / scan.period
     }}
  end

  def answer(_device, _subtype, _body), do: :error

  @doc """
  What the fleet's scene answers: where a thing is, by its name (`simulation`), the floor plan and a part of it (`map`); `:error` for
  what there is not.
  """
  @spec seen(Wire.device(), subtype :: non_neg_integer(), map(), Scene.t()) ::
          {:ok, map()} | :error
  def seen({:simulation, 0}, 1, %{name: name}, scene) do
    # It may end in a zero.
    text = name |> String.split(<<0>>) |> hd()

    case Enum.find(scene.robots ++ scene.objects, &("#{&1.id}" == text)) do
      %{pose: %Pose{x: x, y: y, heading: heading}} ->
        {:ok, %{name: name, pose: {x * 1.0, y * 1.0, heading * 1.0}}}

      _none ->
        :error
    end
  end

  def seen({:map, 0}, _subtype, _values, %{map: nil}), do: :error

  def seen({:map, 0}, 1, _none, %{map: map}) do
    {columns, rows, size} = Drawing.cells(map)
    {width, height} = Floorplan.size(map)
    origin = {-width / 2, -height / 2, 0.0}
    {:ok, %{scale: size * 1.0, width: columns, height: rows, origin: origin}}
  end

  # A cell is 1 where there is wall, -1 where there is none.
  def seen({:map, 0}, 2, tile, %{map: map}) do
    {columns, rows, _size} = Drawing.cells(map)

    if tile.column + tile.width <= columns and tile.row + tile.height <= rows do
      cells = Drawing.ground(map, <<1>>, <<-1>>)

      data =
        for row <- tile.row..(tile.row + tile.height - 1)//1,
            into: "",
            do: binary_part(cells, row * columns + tile.column, tile.width)

      data = :zlib.compress(data)
      {:ok, %{tile | count: byte_size(data), range: 1, data: data}}
    else
      :error
    end
  end

  defp elements(0, body), do: {Pose.new(0, 0), body.sonars}
  defp elements(1, body), do: {Pose.new(0, 0), body.profile.irs}
  defp elements(2, body), do: {body.profile.scan.pose, [Pose.new(0, 0)]}

  @doc """
  What a lidar sees: the angles of its first and its last ray, from the heading of its pose (radians).

      iex> {least, most} = Player.Devices.span(%{Hal.Profile.scan() | rays: 3, field_of_view: 2.0})
      iex> {Float.round(least, 6), Float.round(most, 6)}
      {-1.0, 1.0}
  """
  @spec span(Profile.scan()) :: {float(), float()}
  def span(%{field_of_view: width} = scan) do
    # The last ray of a whole turn is beside its first.
    last = if whole?(scan), do: width / 2 - step(scan), else: width / 2
    {-width / 2, last}
  end

  @doc "The angle between two rays of a lidar (radians)."
  @spec step(Profile.scan()) :: float()
  def step(%{field_of_view: width, rays: rays} = scan),
    do: if(whole?(scan), do: width / rays, else: width / max(rays - 1, 1))

  defp whole?(%{field_of_view: width}), do: width > 2 * :math.pi() - 1.0e-6

  defp geometry(nil), do: %{at(Pose.new(0, 0)) | size: {0.0, 0.0, 0.0}}

  defp geometry(profile),
    do: %{
      at(Pose.new(profile.offset, 0))
      | size: {profile.width * 1.0, profile.length * 1.0, profile.height * 1.0}
    }

  defp camera(%{camera: camera}) do
    mount = Map.get(camera, :mount_height, 0.0) * 1.0
    %{pose: {0.0, 0.0, mount, 0.0, 0.0, 0.0}, size: {0.0, 0.0, 0.0}}
  end

  defp at(pose), do: %{pose: pose(pose), size: {0.0, 0.0, 0.0}}

  # Segments of the body's circle, whose middles begin ahead and go to the left.
  defp bumpers(%{bumpers: count, radius: radius}) do
    for k <- 0..(count - 1) do
      heading = 2 * :math.pi() * k / count
      middle = Pose.compose(Pose.new(0, 0, heading), Pose.new(radius, 0))
      %{pose: pose(middle), length: 2 * :math.pi() * radius / count, radius: radius * 1.0}
    end
  end

  defp pose(%Pose{x: x, y: y, heading: heading}),
    do: {x * 1.0, y * 1.0, 0.0, 0.0, 0.0, heading * 1.0}
end
