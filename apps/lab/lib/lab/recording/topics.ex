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

  @enforce_keys [:channels]
  defstruct @enforce_keys ++ [told: 0, paths: %{}]

  @typedoc "The channels' ids by topic; how many stages were told; the robots' ways, newest first."
  @type t :: %__MODULE__{
          channels: %{(String.t() | {atom(), atom()}) => 1..0xFFFF},
          told: non_neg_integer(),
          paths: Drawing.paths()
        }

  @doc "Registers the topics, those of pictures if there may be some, and records the start."
  @spec open(Writer.t(), Setup.t(), pictures? :: boolean()) :: {t(), Writer.t(), iodata()}
  def open(writer, setup, pictures? \\ false) do
    {start, ticks, encoding} = Recording.topics()
    kinds = [:pose, :state, :blobs] ++ if(pictures?, do: [:camera, :boxes], else: [])
    of_robots = for robot <- setup.robots, what <- kinds, do: Shared.of_robot(robot.id, what)

    topics =
      for({topic, name} <- Enum.sort(@schemas), do: {topic, topic, Foxglove.schema(name)}) ++
        for(topic <- ["/mission", "/messages"], do: {topic, topic, nil}) ++ of_robots

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

    messages =
      [{ticks, bytes}] ++
        if(rem(at_ms, @poses_ms) == 0, do: [{"/tf", Drawing.transforms(ns, scene)}], else: []) ++
        if(rem(at_ms, @scene_ms) == 0, do: [{"/scene", Drawing.scene(ns, scene)}], else: []) ++
        if(rem(at_ms, @paths_ms) == 0, do: [{"/paths", Drawing.paths(ns, paths)}], else: []) ++
        for(stage <- news, do: {"/log", Facts.stage(ns, stage)}) ++
        Facts.sent(ns, facts, rem(at_ms, @robots_ms) < @poses_ms) ++
        if(rem(at_ms, @robots_ms) == 0,
          do: [{"/mission", Facts.mission(scene)} | Facts.robots(facts, scene)],
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
