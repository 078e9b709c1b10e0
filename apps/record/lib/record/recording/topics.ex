defmodule Record.Recording.Topics do
  @moduledoc """
  Describes what other tools see of a recording of robots of processes, from the same entries that a replay
  reads. A robot knows no truth: all poses are its own estimates. Pure.

  | topic | what | schema |
  |---|---|---|
  | `/tf` | where each robot believes its body to be, 5 Hz | `foxglove.FrameTransforms` |
  | `/log` | phases, stages and stops, as they happen | `foxglove.Log` |
  | `/ROBOT/pose` | the same as in `/tf`, 2 Hz | `foxglove.PoseInFrame` |
  | `/ROBOT/state` | its phase, speed, limits, doubt, 2 Hz | plain JSON |
  | `/ROBOT/blobs` | what its camera saw, at most 5 Hz | plain JSON |
  | `/ROBOT/scene` | itself, the others, what it sees, where it goes, 1 Hz | `foxglove.SceneUpdate` |
  | `/ROBOT/mission` | what its mission claims: leader, epoch, formed, …, 2 Hz | plain JSON |
  | `/ROBOT/messages` | what its mission heard and sent | plain JSON |
  | `/ROBOT/camera` | its pictures, if they are recorded | `foxglove.CompressedImage` |
  | `/ROBOT/camera/blobs` | the blobs in its pictures, then | `foxglove.ImageAnnotations` |
  """
  alias Hal.{Json, Pose, Twist}
  alias Mcap.Foxglove
  alias Robot.Percept
  alias Record.Recording.Drawing

  defstruct robots: %{}, pictures?: false

  @typedoc "What was last said of each robot, and when; whether there are pictures."
  @type t :: %__MODULE__{robots: %{atom() => map()}, pictures?: boolean()}
  @type key :: String.t() | {robot :: atom(), what :: atom()}

  @of_robots [
    pose: "foxglove.PoseInFrame",
    state: nil,
    blobs: nil,
    scene: "foxglove.SceneUpdate",
    mission: nil,
    messages: nil
  ]
  @of_pictures [camera: "foxglove.CompressedImage", boxes: "foxglove.ImageAnnotations"]

  # Ticks come every 100 ms, more or less.
  @every_ms %{place: 150, state: 450, blobs: 150, scene: 950, mission: 450}
  @new %{phase: :idle, driving: nil, picture_ms: nil, goal: nil, said_ms: %{}}

  @doc """
  The topics of these robots, with those of pictures or without: key, name, and schema or `nil`, all
  JSON.
  """
  @spec list([atom()], pictures? :: boolean()) ::
          [{key(), String.t(), Mcap.Channel.schema() | nil}]
  def list(robots, pictures?) do
    [
      {"/tf", "/tf", Foxglove.schema("foxglove.FrameTransforms")},
      {"/log", "/log", Foxglove.schema("foxglove.Log")}
    ] ++
      for id <- robots,
          what <- Keyword.keys(@of_robots ++ if(pictures?, do: @of_pictures, else: [])),
          do: of_robot(id, what)
  end

  @doc """
  A topic of a robot, as in `list/2`.

      iex> Record.Recording.Topics.of_robot(:mag1, :state)
      {{:mag1, :state}, "/mag1/state", nil}
  """
  @spec of_robot(robot :: atom(), what :: atom()) ::
          {key(), String.t(), Mcap.Channel.schema() | nil}
  def of_robot(id, what) do
    schema = (@of_robots ++ @of_pictures)[what]
    {{id, what}, "/#{id}/#{name(what)}", schema && Foxglove.schema(schema)}
  end

  defp name(:boxes), do: "camera/blobs"
  defp name(what), do: what

  @doc "A picture of a robot's camera as a message, taken at that time by its clock."
  @spec picture(atom(), Vision.View.Picture.t(), offset_ms :: integer()) ::
          {key(), ns :: non_neg_integer(), iodata()}
  def picture(id, picture, offset_ms) do
    ns = unix_ns(picture.at_ms, offset_ms)
    {{id, :camera}, ns, Foxglove.compressed_image(ns, "#{id}", picture.jpeg)}
  end

  defp unix_ns(at_ms, offset_ms), do: max((at_ms + offset_ms) * 1_000_000, 0)

  @doc "What an entry of a robot says, as messages with their times (ns since 1970)."
  @spec entry(t(), atom(), Robot.Trace.entry(), offset_ms :: integer()) ::
          {t(), [{key(), ns :: non_neg_integer(), iodata()}]}
  def entry(%__MODULE__{} = topics, id, {role, kind, what, at_ms}, offset_ms) do
    robot = Map.get(topics.robots, id, @new)
    ns = unix_ns(at_ms, offset_ms)
    {robot, messages} = said(robot, id, {role, kind, what}, at_ms, ns)
    messages = for {key, data} <- messages, do: {key, ns, data}
    boxes = if topics.pictures?, do: boxes(messages, id, what, offset_ms), else: []
    {%{topics | robots: Map.put(topics.robots, id, robot)}, messages ++ boxes}
  end

  # With its blobs, at the time of their picture.
  defp boxes(messages, id, what, offset_ms) do
    for {{^id, :blobs}, ns, _data} <- messages,
        {:cast, :pilot, {:tick, %{detections: %{at_ms: at_ms} = picture}}} <- [what],
        do: {{id, :boxes}, ns, Drawing.boxes(unix_ns(at_ms, offset_ms), picture)}
  end

  defp said(
         robot,
         id,
         {:executive, :effect, {:cast, :pilot, {:tick, %Percept{} = percept}}},
         at_ms,
         ns
       ) do
    {state, robot} = due(robot, :state, at_ms, fn -> state(robot, id, percept, ns) end)
    {blobs, robot} = blobs(robot, id, percept.detections, at_ms)
    {place, robot} = place(robot, id, percept.pose, at_ms, ns)
    {scene, robot} = scene(robot, id, percept, at_ms, ns)
    {robot, place ++ scene ++ state ++ blobs}
  end

  defp said(robot, _id, {:gate, :effect, {:drive, %Twist{} = twist, limits}}, _at_ms, _ns),
    do: {%{robot | driving: {twist, limits}}, []}

  defp said(robot, id, {:gate, :input, {:ask, nil, what}}, _at_ms, ns)
       when what in [:estop, :reset],
       do: {robot, [log(ns, :warning, id, "#{what}")]}

  defp said(robot, id, {:gate, :input, {:cast, {:latch, _then}}}, _at_ms, ns),
    do: {robot, [log(ns, :warning, id, "estop")]}

  defp said(robot, id, {:gate, :input, {:cast, {:unlatch, _presses, _about}}}, _at_ms, ns),
    do: {robot, [log(ns, :warning, id, "reset")]}

  defp said(
         robot,
         _id,
         {:pilot, :effect, {:cast, :executive, {:obey, {:goal, _tag, goal}}}},
         _at_ms,
         _ns
       ),
       do: {%{robot | goal: goal_pose(goal)}, []}

  defp said(robot, id, {:pilot, :effect, {:claim, claim}}, at_ms, _ns) do
    {said, robot} = due(robot, :mission, at_ms, fn -> [{{id, :mission}, claim(claim)}] end)
    {robot, said}
  end

  defp said(robot, id, {:pilot, :effect, {:send, to, message}}, _at_ms, _ns) do
    {robot, [{{id, :messages}, message(id, to, message)}]}
  end

  defp said(robot, id, {:pilot, :input, {:cast, {:message, message}}}, _at_ms, _ns),
    do: {robot, [{{id, :messages}, message(sender(message), id, message)}]}

  defp said(robot, id, {:pilot, :effect, {:phase, state}}, _at_ms, ns),
    do: {%{robot | phase: phase(state)}, [log(ns, :info, id, "phase #{words(state)}")]}

  defp said(robot, id, {:pilot, :effect, {:stage, stage, facts}}, _at_ms, ns) do
    {robot, [{"/log", Drawing.stage(ns, id, stage, facts)}]}
  end

  defp said(robot, id, {role, :lost, count}, _at_ms, ns),
    do: {robot, [log(ns, :warning, id, "#{count} entries of its #{role} were not recorded")]}

  defp said(robot, _id, _other, _at_ms, _ns), do: {robot, []}

  defp log(ns, level, id, text), do: {"/log", Foxglove.log(ns, level, "#{id}", text)}

  defp phase({_mission, phase}), do: phase
  defp phase(idle), do: idle

  defp words({mission, phase}), do: "#{phase} of #{inspect(mission)}"
  defp words(idle), do: "#{idle}"

  # Of missions and their messages it is known only what they have in common.
  defp goal_pose({_module, options}) when is_list(options) do
    case Keyword.keyword?(options) && options[:target] do
      %Pose{} = pose -> pose
      _other -> nil
    end
  end

  defp goal_pose(_other), do: nil

  defp message(from, to, message),
    do: Json.encode!(Drawing.message(from, to, kind(message)))

  defp sender(%{from: from}) when is_atom(from), do: from
  defp sender(_other), do: "?"

  @doc "What kind of message a mission has sent, as far as it is known."
  @spec kind(struct()) :: atom() | nil
  def kind(%{kind: kind}) when is_atom(kind), do: kind
  def kind(%Robot.Mission.Claim{}), do: :claim
  def kind(_other), do: nil

  # What is said only so often.
  defp due(robot, what, at_ms, say) do
    case robot.said_ms do
      %{^what => said_ms} when at_ms - said_ms < :erlang.map_get(what, @every_ms) -> {[], robot}
      _earlier -> {say.(), put_in(robot.said_ms[what], at_ms)}
    end
  end

  defp claim(claim) do
    facts =
      for {key, value} <- Enum.sort(claim),
          is_atom(value) or is_number(value) or (is_binary(value) and String.valid?(value)),
          do: {key, value}

    Json.encode!({:object, facts})
  end

  defp scene(robot, id, %{pose: %Pose{}} = percept, at_ms, ns) do
    due(robot, :scene, at_ms, fn ->
      [{{id, :scene}, Drawing.scene(ns, percept, "#{robot.phase}", robot.goal)}]
    end)
  end

  defp scene(robot, _id, _percept, _at_ms, _ns), do: {[], robot}

  defp place(robot, _id, nil, _at_ms, _ns), do: {[], robot}

  defp place(robot, id, pose, at_ms, ns) do
    due(robot, :place, at_ms, fn ->
      [{"/tf", Foxglove.frame_transforms(ns, [{"map", Atom.to_string(id), pose}])}]
    end)
  end

  defp state(robot, id, percept, ns) do
    within = with %{radius: radius} <- percept.uncertainty, do: radius
    facts = [phase: robot.phase, within_m: within] ++ driving(robot.driving)

    [{{id, :state}, Json.encode!({:object, facts})}] ++
      for %Pose{} = pose <- [percept.pose],
          do: {{id, :pose}, Foxglove.pose_in_frame(ns, "map", pose)}
  end

  defp driving(nil), do: []

  defp driving({twist, limits}),
    do: [speed_m_s: twist.linear, turn_rad_s: twist.turn, limits: Enum.map(limits, &"#{&1}")]

  defp blobs(robot, _id, nil, _at_ms), do: {[], robot}
  defp blobs(%{picture_ms: at_ms} = robot, _id, %{at_ms: at_ms}, _now_ms), do: {[], robot}

  defp blobs(robot, id, %{at_ms: taken_ms} = seen, at_ms) do
    {said, robot} = due(robot, :blobs, at_ms, fn -> [{{id, :blobs}, Drawing.blobs(seen)}] end)
    {said, if(said == [], do: robot, else: %{robot | picture_ms: taken_ms})}
  end
end
