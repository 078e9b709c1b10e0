defmodule Lab.Recording.Topics do
  @moduledoc """
  Lists the topics of a run's recording, and what a tick says on each of them. Pure.

  | topic | what | schema |
  |---|---|---|
  | `/convoy/start`, `/convoy/ticks` | what a replay needs (`Lab.Recording`) | none |
  | `/map` | the floor plan, once | `foxglove.Grid` |
  | `/tf` | where each robot's body is, 5 Hz | `foxglove.FrameTransforms` |
  | `/scene` | bodies, landmark, places in the formation, 1 Hz | `foxglove.SceneUpdate` |
  | `/paths` | the way that each robot went, every 5 s | `foxglove.SceneUpdate` |
  | `/log` | what happened to the fleet, as it happens | `foxglove.Log` |
  | `/mission` | numbers of the formation, 2 Hz | plain JSON |
  | `/messages` | each message with its sender and receiver | plain JSON |
  | `/ROBOT/pose` | where the robot told others that it is, 2 Hz | `foxglove.PoseInFrame` |
  | `/ROBOT/state` | its phase, speed, error and doubt, 2 Hz | plain JSON |
  | `/ROBOT/blobs` | what its camera saw, 2 Hz | plain JSON |
  | `/ROBOT/camera` | its pictures, if they are recorded | `foxglove.CompressedImage` |
  | `/ROBOT/camera/blobs` | the blobs in each of them | `foxglove.ImageAnnotations` |
  """
  alias Mcap.{Foxglove, Writer}
  alias Lab.Recording
  alias Sim.Scene
  alias Lab.Recording.{Drawing, Facts}
  alias Lab.Trial.Setup
  alias Record.Recording.Topics, as: Shared

  @robots_ms 500
  @scene_ms 1_000
  # A heartbeat of each robot is in them.
  @poses_ms 200
  @paths_ms 5_000
  @schemas %{
    "/map" => "foxglove.Grid",
    "/tf" => "foxglove.FrameTransforms",
    "/scene" => "foxglove.SceneUpdate",
    "/paths" => "foxglove.SceneUpdate",
    "/log" => "foxglove.Log"
  }
  @of_robots [:pose, :state, :blobs]
  @of_pictures [:camera, :boxes]

  # What a scene says by itself, and how often: a viewer of a live fleet gets the same.
  @live [
    {"/map", :once},
    {"/tf", @poses_ms},
    {"/scene", @scene_ms},
    {"/paths", @paths_ms},
    {"/log", 0},
    {"/mission", @robots_ms}
  ]
  @live_robot [pose: @poses_ms, state: @robots_ms]

  @enforce_keys [:channels]
  defstruct @enforce_keys ++ [told: 0, paths: %{}]

  @typedoc "The channels' ids by topic; how many stages were told; the robots' ways, newest first."
  @type t :: %__MODULE__{
          channels: %{(String.t() | {atom(), atom()}) => 1..0xFFFF},
          told: non_neg_integer(),
          paths: Drawing.paths()
        }
  @type key :: String.t() | {robot :: atom(), what :: atom()}
  @type topic :: {key(), String.t(), Mcap.Channel.schema() | nil}

  @doc "The topics of these robots, with those of pictures or without: key, name, and schema or `nil`, all JSON."
  @spec list([atom()], pictures? :: boolean()) :: [topic()]
  def list(robots, pictures?) do
    kinds = @of_robots ++ if(pictures?, do: @of_pictures, else: [])

    for({topic, name} <- Enum.sort(@schemas), do: {topic, topic, Foxglove.schema(name)}) ++
      for(topic <- ["/mission", "/messages"], do: {topic, topic, nil}) ++
      for robot <- robots, what <- kinds, do: Shared.of_robot(robot, what)
  end

  @doc """
  Those among them that a scene alone says (`say/4`), each with its period in ms; `/map` is said once, and `/log` when
  something happens.
  """
  @spec live([atom()]) :: [{topic(), every_ms :: non_neg_integer() | :once}]
  def live(robots) do
    periods =
      Map.new(@live ++ for(robot <- robots, {what, ms} <- @live_robot, do: {{robot, what}, ms}))

    for {key, _name, _schema} = topic <- list(robots, false),
        is_map_key(periods, key),
        do: {topic, periods[key]}
  end

  @doc """
  What a scene says on a topic, at a time in ns; with the robots' ways until then (`Lab.Recording.Drawing.note/2`). `nil` of a
  robot that it has not.
  """
  @spec say(key(), non_neg_integer(), Scene.t(), Drawing.paths()) :: iodata() | nil
  def say("/map", _ns, scene, _paths), do: scene.map && Drawing.map(scene.map)
  def say("/tf", ns, scene, _paths), do: Drawing.transforms(ns, scene)
  def say("/scene", ns, scene, _paths), do: Drawing.scene(ns, scene)
  def say("/paths", ns, _scene, paths), do: Drawing.paths(ns, paths)
  def say("/mission", _ns, scene, _paths), do: Facts.mission(scene)

  def say({id, what}, ns, scene, _paths) do
    with %{} = robot <- Enum.find(scene.robots, &(&1.id == id)) do
      case what do
        :pose -> Foxglove.pose_in_frame(ns, "map", robot.pose)
        :state -> Facts.state(robot, nil)
      end
    end
  end

  @doc "Registers the topics, those of pictures if there may be some, and records the start."
  @spec open(Writer.t(), Setup.t(), pictures? :: boolean()) :: {t(), Writer.t(), iodata()}
  def open(writer, setup, pictures? \\ false) do
    {start, ticks, encoding} = Recording.topics()
    topics = list(for(robot <- setup.robots, do: robot.id), pictures?)

    {channels, writer} =
      (for(topic <- [start, ticks], do: {topic, topic, encoding, nil}) ++
         for({key, topic, schema} <- topics, do: {key, topic, "json", schema}))
      |> Enum.map_reduce(writer, fn {key, topic, encoding, schema}, writer ->
        {id, writer} = Writer.channel(writer, topic, encoding, schema)
        {{key, id}, writer}
      end)

    topics = %__MODULE__{channels: Map.new(channels)}
    first = [{start, Recording.start(setup)}, {"/map", Drawing.map(setup.world.map)}]
    {writer, bytes} = write(topics, writer, 0, first)
    {topics, writer, bytes}
  end

  @typedoc "A tick for the recorder: what a replay needs, as bytes, and what viewers show."
  @type tick :: {at_ms :: non_neg_integer(), ticks :: binary(), Facts.t()}

  @doc """
  A tick as `tick/4` takes it. Made by the run itself, because its entries are much larger than their
  bytes: to copy them for another process costs as much as to write them. `pictured` are the robots
  with a picture.
  """
  @spec prepare(Recording.tick(), pictured :: [atom()]) :: tick()
  def prepare({at_ms, entries} = tick, pictured \\ []) do
    facts = Facts.of(entries)

    facts =
      if rem(at_ms, @robots_ms) == 0,
        do: facts,
        else: %{facts | seen: for({id, seen} <- facts.seen, id in pictured, do: {id, seen})}

    {at_ms, Recording.tick(tick), facts}
  end

  @doc "Records a tick, the scene at its end, and its pictures, which are messages already."
  @spec tick(t(), Writer.t(), tick(), Scene.t(), [{atom(), iodata()}]) ::
          {t(), Writer.t(), iodata()}
  def tick(topics, writer, {at_ms, bytes, facts}, %Scene{} = scene, pictures \\ []) do
    {_start, ticks, _encoding} = Recording.topics()
    ns = at_ms * 1_000_000
    news = Scene.news(scene.stages, topics.told)
    paths = Drawing.note(topics.paths, scene)
    due = [{"/tf", @poses_ms}, {"/scene", @scene_ms}, {"/paths", @paths_ms}]

    messages =
      [{ticks, bytes}] ++
        for({key, ms} <- due, rem(at_ms, ms) == 0, do: {key, say(key, ns, scene, paths)}) ++
        for(stage <- news, do: {"/log", Facts.stage(ns, stage)}) ++
        Facts.sent(ns, facts, rem(at_ms, @robots_ms) < @poses_ms) ++
        if(rem(at_ms, @robots_ms) == 0,
          do: [{"/mission", say("/mission", ns, scene, paths)} | Facts.robots(facts, scene)],
          else: []
        ) ++
        Enum.flat_map(pictures, &picture(&1, facts.seen))

    {writer, bytes} = write(topics, writer, ns, messages)
    {%{topics | told: Scene.told(scene.stages), paths: paths}, writer, bytes}
  end

  # The picture is the one in which the blobs of this tick were found.
  defp picture({id, picture}, seen) do
    [{{id, :camera}, picture}] ++
      for {^id, seen} <- seen,
          do: {{id, :boxes}, Record.Recording.Drawing.boxes(seen.at_ms * 1_000_000, seen)}
  end

  defp write(topics, writer, ns, messages) do
    Enum.reduce(messages, {writer, []}, fn {key, data}, {writer, bytes} ->
      {writer, more} = Writer.message(writer, Map.fetch!(topics.channels, key), ns, data)
      {writer, if(more == [], do: bytes, else: [bytes | more])}
    end)
  end
end
