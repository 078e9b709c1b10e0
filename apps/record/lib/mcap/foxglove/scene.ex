defmodule Mcap.Foxglove.Scene do
  @moduledoc """
  Describes what a `foxglove.SceneUpdate` shows: entities made of simple bodies. Pure.

      body = Mcap.Foxglove.Scene.cylinder(pose, {0.4, 0.4, 0.3}, {0.2, 0.4, 1.0})
      robot = Mcap.Foxglove.Scene.entity(ns, "map", "mag1", [body])
      payload = Mcap.Foxglove.scene_update([robot])

  A body's pose is in the frame of its entity. An entity replaces the one of its id on the same topic.
  """
  import Mcap.Foxglove.Encode
  alias Mcap.Foxglove.Encode

  @kinds [:arrows, :cubes, :spheres, :cylinders, :lines, :triangles, :texts, :models]

  @typedoc "A body: its kind, and its JSON."
  @opaque body :: {atom(), iodata()}

  @typedoc "An entity, or the deletion of one, as JSON."
  @type entity :: iodata()
  @type deletion :: iodata()

  @doc """
  An entity of some bodies. Options: `lifetime_ns` (0: until it is replaced), `frame_locked` (`false`; whether it
  moves along with its frame), `metadata` (`[{key, value}]`, which viewers show when it is selected).
  """
  @spec entity(non_neg_integer(), String.t(), String.t(), [body()], keyword()) :: entity()
  def entity(ns, frame_id, id, bodies, options \\ []) do
    options = Keyword.validate!(options, lifetime_ns: 0, frame_locked: false, metadata: [])
    by_kind = Enum.group_by(bodies, &elem(&1, 0), &elem(&1, 1))

    [
      [~S({"timestamp":), time(ns), ~S(,"frame_id":), text(frame_id), ~S(,"id":), text(id)],
      [~S(,"lifetime":), time(options[:lifetime_ns])],
      [~S(,"frame_locked":), Atom.to_string(options[:frame_locked] == true)],
      [~S(,"metadata":), array(options[:metadata], &pair/1)],
      for(kind <- @kinds, do: [?,, ?", Atom.to_string(kind), ~S(":), list(by_kind[kind])]),
      ?}
    ]
  end

  defp list(nil), do: "[]"
  defp list(bodies), do: array(bodies, & &1)

  defp pair({key, value}), do: [~S({"key":), text(key), ~S(,"value":), text(value), ?}]

  @doc "Takes away the entity of this id, if it is older."
  @spec delete(non_neg_integer(), String.t()) :: deletion()
  def delete(ns, id), do: [~S({"timestamp":), time(ns), ~S(,"type":0,"id":), text(id), ?}]

  @doc "Takes away all entities of the topic that are older."
  @spec delete_all(non_neg_integer()) :: deletion()
  def delete_all(ns), do: [~S({"timestamp":), time(ns), ~S(,"type":1,"id":""})]

  @doc "A box of this size round its pose, in metres."
  @spec cube(Encode.pose(), Encode.point(), Encode.color()) :: body()
  def cube(pose, size, color), do: {:cubes, solid(pose, size, color, [])}

  @doc "A ball of this size round its pose, in metres."
  @spec sphere(Encode.pose(), Encode.point(), Encode.color()) :: body()
  def sphere(pose, size, color), do: {:spheres, solid(pose, size, color, [])}

  @doc "An upright cylinder of this size round its pose; its ends may be narrower, `{bottom, top}` of 0 to 1."
  @spec cylinder(Encode.pose(), Encode.point(), Encode.color(), {number(), number()}) :: body()
  def cylinder(pose, size, color, {bottom, top} \\ {1, 1}) do
    scales = [~S(,"bottom_scale":), number(bottom), ~S(,"top_scale":), number(top)]
    {:cylinders, solid(pose, size, color, scales)}
  end

  defp solid(pose, size, color, more) do
    [~S({"pose":), pose(pose), ~S(,"size":), point(size), more, ~S(,"color":), color(color), ?}]
  end

  @doc "An arrow from its pose ahead: `{shaft_length, shaft_diameter, head_length, head_diameter}` in metres."
  @spec arrow(Encode.pose(), {number(), number(), number(), number()}, Encode.color()) :: body()
  def arrow(pose, {shaft_length, shaft_diameter, head_length, head_diameter}, color) do
    {:arrows,
     [
       [~S({"pose":), pose(pose), ~S(,"shaft_length":), number(shaft_length)],
       [~S(,"shaft_diameter":), number(shaft_diameter), ~S(,"head_length":), number(head_length)],
       [~S(,"head_diameter":), number(head_diameter), ~S(,"color":), color(color), ?}]
     ]}
  end

  @doc """
  A line through points. Options: `kind` (`:strip`; `:loop` returns to its begin, `:list` is pairs of points), `pose`
  (of the points), `pixels` (`false`; whether the thickness is in pixels instead of metres).
  """
  @spec line([Encode.point()], thickness :: number(), Encode.color(), keyword()) :: body()
  def line(points, thickness, color, options \\ []) do
    options = Keyword.validate!(options, kind: :strip, pose: {{0, 0, 0}, 0}, pixels: false)
    kind = Map.fetch!(%{strip: "0", loop: "1", list: "2"}, options[:kind])

    {:lines,
     [
       [~S({"type":), kind, ~S(,"pose":), pose(options[:pose]), ~S(,"thickness":)],
       [number(thickness), ~S(,"scale_invariant":), Atom.to_string(options[:pixels] == true)],
       [~S(,"points":), array(points, &point/1), ~S(,"color":), color(color)],
       ~S(,"colors":[],"indices":[]})
     ]}
  end

  @doc """
  A text at its pose, in letters of this height in metres. Options: `billboard` (`true`; whether it turns to who
  looks), `pixels` (`false`; whether the height is in pixels).
  """
  @spec text(Encode.pose(), String.t(), number(), Encode.color(), keyword()) :: body()
  def text(pose, text, height, color, options \\ []) do
    options = Keyword.validate!(options, billboard: true, pixels: false)

    {:texts,
     [
       [~S({"pose":), pose(pose), ~S(,"billboard":), Atom.to_string(options[:billboard] == true)],
       [~S(,"font_size":), number(height), ~S(,"scale_invariant":)],
       [Atom.to_string(options[:pixels] == true), ~S(,"color":), color(color)],
       [~S(,"text":), text(text), ?}]
     ]}
  end
end
