defmodule Record.Recording.Drawing do
  @moduledoc """
  Draws what a robot knows, for Foxglove and other viewers of its schemas: where it believes itself
  to be, what others told it, what it sees, where it is going. Nothing of a scene is known to be true.
  Its parts, and what it says in words and plain JSON, serve simulated runs, too. Pure.
  """
  alias Hal.{Json, Pose}
  alias Mcap.Foxglove
  alias Mcap.Foxglove.Encode
  alias Mcap.Foxglove.Scene
  alias Robot.Percept
  alias Robot.Percept.Sighting
  alias Vision.Mark

  @frame "map"
  @height 0.4
  @own {0.20, 0.45, 0.80, 1}
  @other {0.50, 0.50, 0.50, 0.6}
  @dead {0.20, 0.20, 0.20, 0.6}
  @seen {0.95, 0.85, 0.10, 0.7}
  @heard {0.85, 0.25, 0.20, 1}
  @goal {0.20, 0.70, 0.30, 0.5}
  @box {1, 1, 1}

  @doc """
  The scene of a robot that knows its pose: its body, the circle in which it is in 95 of 100 cases,
  the other robots, the blobs whose distance it knows, the ends of the beams of its lidar, and the pose to which its goal leads, if any.
  """
  @spec scene(non_neg_integer(), Percept.t(), words :: String.t(), Pose.t() | nil) :: iodata()
  def scene(ns, %Percept{pose: %Pose{}} = percept, words, goal) do
    id = Atom.to_string(percept.robot)

    entities =
      [entity(ns, id, body(place(percept.pose), percept.profile.radius, "#{id} #{words}", @own))] ++
        doubt(ns, percept) ++
        for(
          {peer, heard} <- Enum.sort(percept.peers),
          do: entity(ns, "#{peer}", peer(peer, heard))
        ) ++
        for({place, blob, n} <- seen(percept), do: entity(ns, "seen #{n}", seen(place, blob))) ++
        heard(ns, percept) ++
        for(%Pose{} = goal <- [goal], do: entity(ns, "goal", goal(goal)))

    Foxglove.scene_update(entities, [Scene.delete_all(ns)])
  end

  defp entity(ns, id, bodies), do: Scene.entity(ns, @frame, id, bodies)

  @doc "A robot of this radius (m) with these words above it; in a frame of its own it stands at the origin."
  @spec body({{number(), number()}, heading :: number()}, number(), String.t(), Encode.color()) ::
          [Scene.body()]
  def body({{x, y}, heading}, radius, words, colour) do
    [
      Scene.cylinder(
        {{x, y, @height / 2}, heading},
        {2 * radius, 2 * radius, @height},
        colour
      ),
      Scene.arrow(
        {{x, y, @height + 0.05}, heading},
        {radius, 0.06, 0.12, 0.14},
        colour
      ),
      Scene.text({{x, y, @height + 0.3}, 0}, words, 0.2, colour)
    ]
  end

  defp place(%Pose{heading: heading} = pose), do: {Pose.point(pose), heading}

  defp doubt(ns, %{pose: %{x: x, y: y}, uncertainty: %{radius: radius}}) do
    {r, g, b, _a} = @own
    circle = Scene.cylinder({{x, y, 0.005}, 0}, {2 * radius, 2 * radius, 0.01}, {r, g, b, 0.2})
    [entity(ns, "doubt", [circle])]
  end

  defp doubt(_ns, _percept), do: []

  defp peer(id, %{mode: mode} = heard) do
    colour = if mode == :dead, do: @dead, else: @other
    body(place(heard.pose), heard.radius, "#{id} #{mode}", colour)
  end

  # The ends of the beams of its lidar.
  defp heard(ns, %{profile: %{scan: scan, sonars: beams}, sonar: [_ | _] = ranges, pose: pose})
       when scan != nil do
    spots =
      for {beam, range} when is_number(range) and range < scan.max <- Enum.zip(beams, ranges) do
        %Pose{x: x, y: y} = pose |> Pose.compose(beam) |> Pose.compose(Pose.new(range, 0))
        {x, y}
      end

    [heard(ns, @frame, spots)]
  end

  defp heard(_ns, _percept), do: []

  @doc "Where the beams of a lidar or the sonars end, in a frame."
  @spec heard(non_neg_integer(), frame :: String.t(), [Pose.point()]) :: Scene.entity()
  def heard(ns, frame, places) do
    spots =
      for {x, y} <- places, do: Scene.sphere({{x, y, @height}, 0}, {0.05, 0.05, 0.05}, @heard)

    Scene.entity(ns, frame, "heard", spots)
  end

  defp seen(%{detections: nil}), do: []

  defp seen(%{detections: picture} = percept) do
    width = picture.field_of_view || percept.profile.camera.field_of_view
    from = picture.pose || percept.pose

    for {blob, n} <- Enum.with_index(picture.blobs, 1), blob.distance != nil do
      {Sighting.place(from, Sighting.bearing(blob, picture.pan, width), blob.distance), blob, n}
    end
  end

  defp seen({x, y}, blob) do
    [
      Scene.sphere({{x, y, @height}, 0}, {0.2, 0.2, 0.2}, @seen),
      Scene.text({{x, y, @height + 0.2}, 0}, blob.colour, 0.15, @seen)
    ]
  end

  @doc "A place on the floor."
  @spec spot(Pose.point(), Encode.color()) :: Scene.body()
  def spot({x, y}, colour), do: Scene.cylinder({{x, y, 0.01}, 0}, {0.3, 0.3, 0.02}, colour)

  defp goal(%Pose{x: x, y: y, heading: heading}) do
    [
      spot({x, y}, @goal),
      Scene.arrow({{x, y, 0.02}, heading}, {0.2, 0.04, 0.08, 0.1}, @goal)
    ]
  end

  @doc "What was found in a picture, as boxes that viewers draw on it; `ns` is when it was taken."
  @spec boxes(non_neg_integer(), Vision.Detections.t()) :: iodata()
  def boxes(ns, %{blobs: blobs, marks: marks}) do
    boxes = for blob <- blobs, do: {{blob.left, blob.top, blob.right, blob.bottom}, blob.colour}
    marks = for mark <- marks || [], do: {Mark.box(mark), Mark.name(mark)}
    Foxglove.image_boxes(ns, boxes ++ marks, @box)
  end

  @blob [:colour, :area, :x, :y, :left, :top, :right, :bottom]
  @mark [:family, :id, :at_ms, :x, :y, :range, :bearing, :yaw, :range_sd, :bearing_sd, :yaw_sd]

  @doc "The same as plain JSON."
  @spec blobs(Vision.Detections.t()) :: binary()
  def blobs(%{pan: pan, blobs: blobs, marks: marks}) do
    objects = fn all, keys ->
      for one <- all, do: {:object, for(key <- keys, do: {key, Map.fetch!(one, key)})}
    end

    # Of a robot that looks for none, nothing.
    marks = if marks, do: [marks: objects.(marks, @mark)], else: []
    Json.encode!({:object, [pan: pan, blobs: objects.(blobs, @blob)] ++ marks})
  end

  @doc "Sender, receiver and kind of a message, for `Hal.Json`."
  @spec message(from :: atom() | String.t(), to :: term(), kind :: atom()) :: Json.value()
  def message(from, to, kind),
    do: {:object, from: from, to: List.wrap(to), kind: kind || "?"}

  @bad [:killed, :lost, :refused, :order_refused, :cannot_form, :given_up, :crashed, :disarmed]

  @doc "A stage of a mission, or what happened to a fleet, as a line of a log, with its facts; `nil` is none."
  @spec stage(non_neg_integer(), who :: atom() | String.t(), stage :: atom(), facts :: map()) ::
          iodata()
  def stage(ns, who, stage, facts) do
    facts = for {key, value} <- Enum.sort(facts), value != nil, do: " #{key} #{word(value)}"
    Foxglove.log(ns, if(stage in @bad, do: :warning, else: :info), "#{who}", "#{stage}#{facts}")
  end

  defp word(value) when is_atom(value) or is_number(value) or is_binary(value), do: "#{value}"
  defp word(value), do: inspect(value)
end
