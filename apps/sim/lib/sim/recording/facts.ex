defmodule Sim.Recording.Facts do
  @moduledoc "Describes what a recording says of a run in words and numbers, for plots and logs. Pure."
  import Mcap.Foxglove.Encode, only: [array: 2, number: 1, text: 1]
  alias Hal.{Json, Pose, Twist}
  alias Mcap.Foxglove
  alias Sim.Scene
  alias Swarm.Message

  @doc "Something that happened, as a line of a log."
  @spec stage(non_neg_integer(), Scene.stage()) :: iodata()
  def stage(ns, %{stage: stage} = about) do
    facts =
      for {key, value} <- about |> Map.drop([:stage, :at_s]) |> Enum.sort(),
          value != nil,
          do: " #{key} #{value}"

    level =
      if stage in [:killed, :lost, :refused, :cannot_form, :given_up, :crashed, :disarmed],
        do: :warning,
        else: :info

    Foxglove.log(ns, level, "#{about[:robot] || "fleet"}", "#{stage}#{facts}")
  end

  @doc "The numbers of the formation."
  @spec mission(Scene.t()) :: iodata()
  def mission(scene) do
    {mean, most} = scene.error || {nil, nil}

    Json.encode!(
      {:object,
       [
         leader: scene.leader,
         epoch: scene.epoch,
         formed: scene.formed?,
         error_mean_m: mean,
         error_max_m: most
       ]}
    )
  end

  @typedoc """
  What a tick's entries say to viewers: who sent what (and where it believed to be, in a heartbeat),
  at what speed each drives, and what each camera saw.
  """
  @type t :: %{
          sent: [{atom(), to :: term(), kind :: atom() | nil, Pose.t() | nil}],
          speeds: %{atom() => Twist.t()},
          seen: [{atom(), Vision.Detections.t()}]
        }

  @doc "What a tick's entries say to viewers: little, because it goes to another process."
  @spec of([Sim.Trial.entry()]) :: t()
  def of(entries) do
    facts = Enum.reduce(entries, %{sent: [], speeds: %{}, seen: []}, &entry/2)
    %{facts | sent: Enum.reverse(facts.sent), seen: Enum.reverse(facts.seen)}
  end

  defp entry({:step, id, {:detections, seen}, []}, facts),
    do: %{facts | seen: [{id, seen} | facts.seen]}

  defp entry({:step, id, _input, [_ | _] = effects}, facts),
    do: Enum.reduce(effects, facts, &effect(&1, id, &2))

  defp entry(_other, facts), do: facts

  defp effect({:drive, twist}, id, facts), do: %{facts | speeds: Map.put(facts.speeds, id, twist)}

  defp effect({:send, to, %Message{kind: kind} = message}, id, facts),
    do: %{facts | sent: [{id, to, kind, pose(message)} | facts.sent]}

  defp effect(_other, _id, facts), do: facts

  # A heartbeat says where its robot believes to be, in mm and mrad.
  defp pose(%Message{kind: :heartbeat, body: %{pose: {x, y, heading}}}),
    do: Pose.new(x / 1000, y / 1000, heading / 1000)

  defp pose(_message), do: nil

  @doc """
  The messages of a tick, and with `poses?` where robots told the others to be:
  `{{robot, topic} | topic, data}`.
  """
  @spec sent(non_neg_integer(), t(), poses? :: boolean()) :: [{term(), iodata()}]
  def sent(_ns, %{sent: []}, _poses?), do: []

  def sent(ns, %{sent: sent}, poses?) do
    poses =
      for {id, _to, _kind, %Pose{} = pose} <- sent,
          poses?,
          do: {{id, :pose}, Foxglove.pose_in_frame(ns, "map", pose)}

    [{"/messages", [~S({"messages":), array(sent, &message/1), ?}]} | poses]
  end

  defp message({from, to, kind, _pose}) do
    to = to |> List.wrap() |> array(&word/1)
    [~S({"from":), word(from), ~S(,"to":), to, ~S(,"kind":), word(kind), ?}]
  end

  @doc "What the cameras saw, and how the living robots stand at the end of a tick, as `sent/2`."
  @spec robots(t(), Scene.t()) :: [{term(), iodata()}]
  def robots(facts, scene) do
    for({id, seen} <- facts.seen, do: {{id, :blobs}, blobs(seen)}) ++
      for(
        robot <- scene.robots,
        robot.alive,
        do: {{robot.id, :state}, state(robot, facts.speeds[robot.id])}
      )
  end

  defp blobs(seen),
    do: [~S({"pan":), number(seen.pan), ~S(,"blobs":), array(seen.blobs, &blob/1), ?}]

  defp blob(blob) do
    [
      [~S({"colour":), text(blob.colour), ~S(,"area":), number(blob.area)],
      [~S(,"x":), number(blob.x), ~S(,"y":), number(blob.y)],
      [~S(,"left":), number(blob.left), ~S(,"top":), number(blob.top)],
      [~S(,"right":), number(blob.right), ~S(,"bottom":), number(blob.bottom), ?}]
    ]
  end

  # Atoms of ours need no quoting.
  defp word(atom), do: [?", Atom.to_string(atom), ?"]

  defp state(robot, speed) do
    [
      [~S({"phase":), word(robot.state), ~S(,"leads":), Atom.to_string(robot.leader?)],
      [~S(,"error_m":), value(Scene.slot_error(robot))],
      [~S(,"within_m":), value(robot.uncertainty), ~S(,"size_ppm":), value(robot.size_ppm)],
      [speed(speed), ?}]
    ]
  end

  defp value(nil), do: "null"
  defp value(number), do: number(number)

  defp speed(nil), do: []

  defp speed(%Twist{linear: linear, turn: turn}),
    do: [~S(,"speed_m_s":), number(linear), ~S(,"turn_rad_s":), number(turn)]
end
