defmodule Bridge.Ros do
  @moduledoc """
  Describes what a live fleet says to programs for ROS, as messages of its standard kinds. Pure. Each topic is there as JSON
  and as CBOR, whole frames of rosbridge's operation `publish`.

  | topic | kind | how often |
  |---|---|---|
  | `/map` | `nav_msgs/OccupancyGrid`, the floor plan | once |
  | `/tf` | `tf2_msgs/TFMessage`, from `map` to each robot | 5 Hz |
  | `/mission` | `std_msgs/String`, what the mission claims, as JSON | 2 Hz |
  | `/rosout` | `rosgraph_msgs/Log`, stages and orders | as it happens |
  | `/ROBOT/pose` | `geometry_msgs/PoseStamped`, in `map` | 5 Hz |
  | `/ROBOT/odom` | `nav_msgs/Odometry`, where it believes to be, its speed and turn | 10 Hz |
  | `/ROBOT/scan` | `sensor_msgs/LaserScan`, its lidar or its sonars, seen from its middle | 5 Hz |
  | `/ROBOT/battery_state` | `sensor_msgs/BatteryState`: the voltage | 0.5 Hz |
  | `/ROBOT/why` | `std_msgs/String`, what it does and why | 2 Hz |

  Stamps have the fields of ROS 1 (`secs`, `nsecs`) and of ROS 2 (`sec`, `nanosec`). Axes are those of REP 103.
  """
  @behaviour Bridge.Catalogue
  alias Bridge.{Catalogue, Cbor, Topics}
  alias Console.Cli.Format
  alias Hal.{Json, Pose}
  alias Lab.Recording.{Drawing, Facts}

  @fleet [
    {"/map", "nav_msgs/OccupancyGrid", :once},
    {"/tf", "tf2_msgs/TFMessage", 200},
    {"/mission", "std_msgs/String", 500},
    {"/rosout", "rosgraph_msgs/Log", :events}
  ]
  @of_scene [{:pose, "geometry_msgs/PoseStamped", 200}]
  @of_robot [
    {:odom, "nav_msgs/Odometry", 100},
    {:scan, "sensor_msgs/LaserScan", 200},
    {:battery_state, "sensor_msgs/BatteryState", 2_000},
    {:why, "std_msgs/String", 500}
  ]
  @asked for {what, _type, _pace} <- @of_robot, do: what
  @frame "map"
  # Levels of rosgraph_msgs/Log.
  @info 2
  @warning 4

  @typedoc "What a program asked for: a topic, in this form."
  @type key :: {topic :: String.t() | {robot :: atom(), what :: atom()}, form :: :none | :cbor}

  @impl Catalogue
  def list(robots) do
    topics =
      for({name, type, pace} <- @fleet, do: {name, name, type, pace}) ++
        for robot <- robots,
            {what, type, pace} <- @of_scene ++ @of_robot,
            do: {{robot, what}, "/#{robot}/#{what}", type, pace}

    for {topic, name, type, pace} <- topics, form <- [:none, :cbor] do
      %{key: {topic, form}, name: name, schema: type, pace: pace}
    end
  end

  @impl Catalogue
  def asks({{robot, what}, _form}) when what in @asked, do: robot
  def asks(_key), do: nil

  @impl Catalogue
  def scene({topic, form}, ns, scene, _paths) do
    message = shown(topic, ns, Catalogue.drawn(scene))
    message && publish(form, name(topic), message)
  end

  defp name({robot, what}), do: "/#{robot}/#{what}"
  defp name(topic), do: topic

  defp shown("/map", _ns, %{map: nil}), do: nil

  defp shown("/map", ns, %{map: map}) do
    {columns, rows, size} = Drawing.cells(map)
    {width, height} = Sim.Floorplan.size(map)
    origin = pose(Pose.new(-width / 2, -height / 2))

    info = %{
      map_load_time: stamp(ns),
      resolution: size,
      width: columns,
      height: rows,
      origin: origin
    }

    %{header: header(ns, @frame), info: info, data: {:bytes, Drawing.ground(map, <<100>>, <<0>>)}}
  end

  defp shown("/tf", ns, scene) do
    transforms =
      for %{id: id, pose: %Pose{} = pose} <- scene.robots do
        %{position: place, orientation: turn} = pose(pose)
        transform = %{translation: place, rotation: turn}
        %{header: header(ns, @frame), child_frame_id: "#{id}", transform: transform}
      end

    %{transforms: transforms}
  end

  defp shown("/mission", _ns, scene),
    do: %{data: scene |> Facts.mission() |> IO.iodata_to_binary()}

  defp shown({robot, :pose}, ns, scene) do
    with %{pose: %Pose{} = pose} <- Enum.find(scene.robots, &(&1.id == robot)),
         do: %{header: header(ns, @frame), pose: pose(pose)}
  end

  @impl Catalogue
  def about({{robot, what} = topic, form}, ns, about),
    do: publish(form, name(topic), known(what, robot, ns, about))

  defp known(:why, _robot, _ns, about), do: %{data: Topics.why(about)}

  # Nothing is known of how likely an error is in each direction.
  defp known(:odom, robot, ns, about) do
    [x, y] = about.pose || [0.0, 0.0]
    covariance = {:floats, List.duplicate(0.0, 36)}
    twist = twist(about.speed || 0.0, about.turn || 0.0)

    %{
      header: header(ns, @frame),
      child_frame_id: "#{robot}",
      pose: %{pose: pose(Pose.new(x, y, about.heading || 0.0)), covariance: covariance},
      twist: %{twist: twist, covariance: covariance}
    }
  end

  defp known(:scan, robot, ns, about) do
    {step, ranges} = ring(about.sonar)

    %{
      header: header(ns, "#{robot}"),
      angle_min: -:math.pi(),
      angle_max: -:math.pi() + step * (length(ranges) - 1),
      angle_increment: step,
      time_increment: 0.0,
      scan_time: 0.1,
      range_min: 0.0,
      range_max: 100.0,
      ranges: {:floats, ranges},
      intensities: {:floats, []}
    }
  end

  defp known(:battery_state, robot, ns, about) do
    %{
      header: header(ns, "#{robot}"),
      voltage: about.power,
      temperature: nil,
      current: nil,
      charge: nil,
      capacity: nil,
      design_capacity: nil,
      percentage: nil,
      power_supply_status: 0,
      power_supply_health: 0,
      power_supply_technology: 0,
      present: about.power != nil,
      cell_voltage: [],
      cell_temperature: [],
      location: "",
      serial_number: ""
    }
  end

  @doc """
  Beams as the ranges of a scan from the middle of the body, all round from behind to the left, as many as there are beams: the nearest in each
  direction, `nil` where there is none. A beam is `[x, y, heading, range]`, in metres and radians.

      iex> beams = [[0.2, 0.0, 0.0, 1.0], [0.0, 0.2, :math.pi() / 2, 2.0], [0.0, 0.1, :math.pi() / 2, 1.0], [-0.2, 0.0, :math.pi(), 3.0]]
      iex> {step, ranges} = Bridge.Ros.ring(beams)
      iex> {Float.round(step, 4), Enum.map(ranges, & &1 && Float.round(&1, 2))}
      {1.5708, [3.2, nil, 1.2, 1.1]}
  """
  @spec ring([[number()]]) :: {step :: float(), [float() | nil]}
  def ring([]), do: {2 * :math.pi(), [nil]}

  def ring(beams) do
    count = length(beams)
    step = 2 * :math.pi() / count

    nearest =
      for [x, y, heading, range] <- beams, reduce: %{} do
        nearest ->
          {x, y} = {x + range * :math.cos(heading), y + range * :math.sin(heading)}
          place = rem(round((:math.atan2(y, x) + :math.pi()) / step), count)
          far = :math.sqrt(x * x + y * y)
          Map.update(nearest, place, far, &min(&1, far))
      end

    {step, for(place <- 0..(count - 1), do: nearest[place])}
  end

  @impl Catalogue
  def log, do: [{"/rosout", :none}, {"/rosout", :cbor}]

  @impl Catalogue
  def stage({_topic, form}, ns, %{line: line} = stage),
    do: line(form, ns, @info, "#{stage[:robot]}", line)

  def stage({_topic, form}, ns, stage),
    do: line(form, ns, @info, "#{stage[:robot] || :fleet}", Format.meaning(stage))

  @impl Catalogue
  def order({_topic, form}, ns, asker, line, {ok?, text}) do
    level = if ok? == :ok, do: @info, else: @warning
    line(form, ns, level, asker, "#{line}: #{text |> List.wrap() |> Enum.join("; ")}")
  end

  defp line(form, ns, level, name, text) do
    line = %{header: header(ns, ""), level: level, name: name, msg: text}
    publish(form, "/rosout", Map.merge(line, %{file: "", function: "", line: 0, topics: []}))
  end

  @doc "A frame that publishes a message, in the form that was asked for."
  @spec publish(:none | :cbor, topic :: String.t(), map()) :: iodata()
  def publish(:cbor, topic, message),
    do: Cbor.encode(%{op: "publish", topic: topic, msg: message})

  def publish(:none, topic, message),
    do: Json.encode!(%{op: "publish", topic: topic, msg: plain(message)})

  # Numbers that CBOR packs stand as such in JSON.
  defp plain({:floats, list}), do: list
  defp plain({:bytes, bytes}), do: for(<<byte::signed-8 <- bytes>>, do: byte)
  defp plain(list) when is_list(list), do: Enum.map(list, &plain/1)
  defp plain(map) when is_map(map), do: Map.new(map, fn {key, value} -> {key, plain(value)} end)
  defp plain(other), do: other

  defp header(ns, frame), do: %{stamp: stamp(ns), frame_id: frame, seq: 0}

  @doc "A time, with the fields of ROS 1 and of ROS 2."
  @spec stamp(ns :: non_neg_integer()) :: map()
  def stamp(ns) do
    {secs, nsecs} = {div(ns, 1_000_000_000), rem(ns, 1_000_000_000)}
    %{secs: secs, nsecs: nsecs, sec: secs, nanosec: nsecs}
  end

  defp pose(%Pose{x: x, y: y, heading: heading}) do
    {sin, cos} = {:math.sin(heading / 2), :math.cos(heading / 2)}
    %{position: vector(x, y, 0.0), orientation: Map.put(vector(0.0, 0.0, sin), :w, cos)}
  end

  defp twist(ahead, left), do: %{linear: vector(ahead, 0.0, 0.0), angular: vector(0.0, 0.0, left)}
  defp vector(x, y, z), do: %{x: x * 1.0, y: y * 1.0, z: z * 1.0}
end
