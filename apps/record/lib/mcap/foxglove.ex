defmodule Mcap.Foxglove do
  @moduledoc """
  Payloads of the kinds that Foxglove and Lichtblick show in three dimensions, as pictures and as a log: JSON as
  iodata, and the schema that says so. Pure.

      {name, _encoding, _text} = schema = Mcap.Foxglove.schema("foxglove.PoseInFrame")
      {id, writer} = Mcap.Writer.channel(writer, "/mag1/pose", "json", schema, %{})
      {writer, now} = Mcap.Writer.message(writer, id, ns, Mcap.Foxglove.pose_in_frame(ns, "map", pose))

  Times are whole nanoseconds since 1970, lengths metres, angles radians, colours 0 to 1. Poses are `Hal.Pose`,
  `{point, yaw}` or `{point, quaternion}` (`t:Mcap.Foxglove.Encode.pose/0`).
  """
  import Mcap.Foxglove.Encode
  alias Mcap.Foxglove.{Encode, Scene, Schemas}

  @types %{u8: 1, i8: 2, u16: 3, i16: 4, u32: 5, i32: 6, f32: 7, f64: 8}
  @levels %{debug: "1", info: "2", warning: "3", error: "4", fatal: "5"}

  @doc "The schema of a name, as `Mcap.Writer.channel/5` takes it."
  @spec schema(String.t()) :: Mcap.Channel.schema()
  def schema(name), do: {name, "jsonschema", Schemas.text(name)}

  @doc """
  `foxglove.FrameTransforms`: where frames are, `{parent, child, pose of the child in its parent}`. What is shown in a
  frame needs its way to the frame that a viewer shows, at that time or before.
  """
  @spec frame_transforms(non_neg_integer(), [{String.t(), String.t(), Encode.pose()}]) :: iodata()
  def frame_transforms(ns, transforms) do
    time = time(ns)
    [~S({"transforms":), array(transforms, &transform(time, &1)), ?}]
  end

  defp transform(time, {parent, child, pose}) do
    {point, turn} = split(pose)

    [
      [~S({"timestamp":), time, ~S(,"parent_frame_id":), text(parent)],
      [~S(,"child_frame_id":), text(child), ~S(,"translation":), point(point)],
      [~S(,"rotation":), turn(turn), ?}]
    ]
  end

  @doc """
  `foxglove.PoseInFrame`.

      iex> Mcap.Foxglove.pose_in_frame(1, "map", Hal.Pose.new(1, 2)) |> IO.iodata_to_binary()
      ~S({"timestamp":{"sec":0,"nsec":1},"frame_id":"map","pose":{"position":{"x":1.0,"y":2.0,"z":0},) <>
        ~S("orientation":{"x":0,"y":0,"z":0.0,"w":1.0}}})
  """
  @spec pose_in_frame(non_neg_integer(), String.t(), Encode.pose()) :: iodata()
  def pose_in_frame(ns, frame_id, pose), do: [stamp(ns, frame_id), ~S(,"pose":), pose(pose), ?}]

  @doc "`foxglove.PosesInFrame`: a path, or the particles of an estimate."
  @spec poses_in_frame(non_neg_integer(), String.t(), [Encode.pose()]) :: iodata()
  def poses_in_frame(ns, frame_id, poses),
    do: [stamp(ns, frame_id), ~S(,"poses":), array(poses, &pose/1), ?}]

  @doc "`foxglove.SceneUpdate`: entities of `Mcap.Foxglove.Scene`, after deletions."
  @spec scene_update([Scene.entity()], [Scene.deletion()]) :: iodata()
  def scene_update(entities, deletions \\ []) do
    [~S({"deletions":), array(deletions, & &1), ~S(,"entities":), array(entities, & &1), ?}]
  end

  @doc ~S(`foxglove.CompressedImage`: the bytes of a picture; `format` is "jpeg", "png", "webp" or "avif".)
  @spec compressed_image(non_neg_integer(), String.t(), binary(), String.t()) :: iodata()
  def compressed_image(ns, frame_id, picture, format \\ "jpeg"),
    do: [stamp(ns, frame_id), ~S(,"data":), bytes(picture), ~S(,"format":), text(format), ?}]

  @doc """
  `foxglove.ImageAnnotations`: boxes on a picture that was taken at that time, `{{left, top, right, bottom}, label}` in
  pixels. Viewers show them on the picture if they are told the topic.
  """
  @spec image_boxes(
          non_neg_integer(),
          [{{number(), number(), number(), number()}, label :: String.t()}],
          Encode.color()
        ) :: iodata()
  def image_boxes(ns, boxes, color) do
    {time, color} = {time(ns), color(color)}

    [
      [~S({"circles":[],"points":), array(boxes, &box(&1, time, color))],
      [~S(,"texts":), array(boxes, &label(&1, time, color)), ?}]
    ]
  end

  @line_loop "2"

  defp box({{left, top, right, bottom}, _label}, time, color) do
    corners = [{left, top}, {right, top}, {right, bottom}, {left, bottom}]

    [
      [~S({"timestamp":), time, ~S(,"type":), @line_loop],
      [~S(,"points":), array(corners, &pixel/1), ~S(,"outline_color":), color],
      [~S(,"outline_colors":[],"fill_color":), color({0, 0, 0, 0}), ~S(,"thickness":1})]
    ]
  end

  # Above its box.
  defp label({{left, top, _right, _bottom}, label}, time, color) do
    [
      [~S({"timestamp":), time, ~S(,"position":), pixel({left, top - 2})],
      [~S(,"text":), text(label), ~S(,"font_size":10,"text_color":), color],
      [~S(,"background_color":), color({0, 0, 0, 0.5}), ?}]
    ]
  end

  defp pixel({x, y}), do: [~S({"x":), number(x), ~S(,"y":), number(y), ?}]

  @doc """
  `foxglove.Log`: what `name` said. Levels: `:debug`, `:info`, `:warning`, `:error`, `:fatal`. `file` and `line` are
  where in the code, if anybody knows.
  """
  @spec log(non_neg_integer(), atom(), String.t(), String.t(), String.t(), non_neg_integer()) ::
          iodata()
  def log(ns, level, name, message, file \\ "", line \\ 0) do
    [
      [~S({"timestamp":), time(ns), ~S(,"level":), Map.fetch!(@levels, level)],
      [~S(,"message":), text(message), ~S(,"name":), text(name)],
      [~S(,"file":), text(file), ~S(,"line":), number(line), ?}]
    ]
  end

  @doc """
  `foxglove.Grid`: a map of cells, row after row in the direction of +y from the corner `pose`. `cell_size` is in
  metres, `row_stride` and `cell_stride` in bytes; `fields` are `{name, offset, type}` of a cell, with the types `:u8`,
  `:i8`, `:u16`, `:i16`, `:u32`, `:i32`, `:f32` and `:f64`.
  """
  @spec grid(non_neg_integer(), String.t(), %{
          pose: Encode.pose(),
          columns: pos_integer(),
          cell_size: {number(), number()},
          row_stride: pos_integer(),
          cell_stride: pos_integer(),
          fields: [{String.t(), non_neg_integer(), atom()}],
          data: binary()
        }) :: iodata()
  def grid(ns, frame_id, grid) do
    {width, height} = grid.cell_size

    [
      [stamp(ns, frame_id), ~S(,"pose":), pose(grid.pose), ~S(,"column_count":)],
      [number(grid.columns), ~S(,"cell_size":{"x":), number(width), ~S(,"y":), number(height)],
      [~S(},"row_stride":), number(grid.row_stride)],
      [
        ~S(,"cell_stride":),
        number(grid.cell_stride),
        ~S(,"fields":),
        array(grid.fields, &field/1)
      ],
      [~S(,"data":), bytes(grid.data), ?}]
    ]
  end

  defp field({name, offset, type}) do
    type = number(Map.fetch!(@types, type))
    [~S({"name":), text(name), ~S(,"offset":), number(offset), ~S(,"type":), type, ?}]
  end

  defp stamp(ns, frame_id), do: [~S({"timestamp":), time(ns), ~S(,"frame_id":), text(frame_id)]
end
