defmodule Mcap.Foxglove.Schemas do
  @moduledoc false
  # Lists the JSON schemas of the messages that `Mcap.Foxglove` makes. Viewers choose the panel by the name. Within what
  # their parser understands: each field has one type, objects list their properties, and there are no references.

  # `[…]` is an array, `{:object, …}` an object with its fields in order; `{:choice, …}` a number by name.
  v2 = {:object, x: :number, y: :number}
  v3 = {:object, x: :number, y: :number, z: :number}
  turn = {:object, x: :number, y: :number, z: :number, w: :number}
  pose = {:object, position: v3, orientation: turn}
  color = {:object, r: :number, g: :number, b: :number, a: :number}
  stamp = [timestamp: :time, frame_id: :string]

  transform =
    {:object,
     timestamp: :time,
     parent_frame_id: :string,
     child_frame_id: :string,
     translation: v3,
     rotation: turn}

  types =
    {:choice,
     UNKNOWN: 0,
     UINT8: 1,
     INT8: 2,
     UINT16: 3,
     INT16: 4,
     UINT32: 5,
     INT32: 6,
     FLOAT32: 7,
     FLOAT64: 8}

  levels = {:choice, UNKNOWN: 0, DEBUG: 1, INFO: 2, WARNING: 3, ERROR: 4, FATAL: 5}
  deletion = {:object, timestamp: :time, type: {:choice, MATCHING_ID: 0, ALL: 1}, id: :string}
  solid = [pose: pose, size: v3, color: color]
  ends = [bottom_scale: :number, top_scale: :number]

  arrow =
    {:object,
     pose: pose,
     shaft_length: :number,
     shaft_diameter: :number,
     head_length: :number,
     head_diameter: :number,
     color: color}

  line =
    {:object,
     type: {:choice, LINE_STRIP: 0, LINE_LOOP: 1, LINE_LIST: 2},
     pose: pose,
     thickness: :number,
     scale_invariant: :boolean,
     points: [v3],
     color: color,
     colors: [color],
     indices: [:integer]}

  triangle =
    {:object, pose: pose, points: [v3], color: color, colors: [color], indices: [:integer]}

  text =
    {:object,
     pose: pose,
     billboard: :boolean,
     font_size: :number,
     scale_invariant: :boolean,
     color: color,
     text: :string}

  model =
    {:object,
     pose: pose,
     scale: v3,
     color: color,
     override_color: :boolean,
     url: :string,
     media_type: :string,
     data: :bytes}

  entity =
    {:object,
     timestamp: :time,
     frame_id: :string,
     id: :string,
     lifetime: :time,
     frame_locked: :boolean,
     metadata: [{:object, key: :string, value: :string}],
     arrows: [arrow],
     cubes: [{:object, solid}],
     spheres: [{:object, solid}],
     cylinders: [{:object, solid ++ ends}],
     lines: [line],
     triangles: [triangle],
     texts: [text],
     models: [model]}

  circle =
    {:object,
     timestamp: :time,
     position: v2,
     diameter: :number,
     thickness: :number,
     fill_color: color,
     outline_color: color}

  outline =
    {:object,
     timestamp: :time,
     type: {:choice, UNKNOWN: 0, POINTS: 1, LINE_LOOP: 2, LINE_STRIP: 3, LINE_LIST: 4},
     points: [v2],
     outline_color: color,
     outline_colors: [color],
     fill_color: color,
     thickness: :number}

  label =
    {:object,
     timestamp: :time,
     position: v2,
     text: :string,
     font_size: :number,
     text_color: color,
     background_color: color}

  @schemas %{
    "foxglove.FrameTransforms" => [transforms: [transform]],
    "foxglove.PoseInFrame" => stamp ++ [pose: pose],
    "foxglove.PosesInFrame" => stamp ++ [poses: [pose]],
    "foxglove.SceneUpdate" => [deletions: [deletion], entities: [entity]],
    "foxglove.CompressedImage" => stamp ++ [data: :bytes, format: :string],
    "foxglove.ImageAnnotations" => [circles: [circle], points: [outline], texts: [label]],
    "foxglove.Log" => [
      timestamp: :time,
      level: levels,
      message: :string,
      name: :string,
      file: :string,
      line: :integer
    ],
    "foxglove.Grid" =>
      stamp ++
        [pose: pose, column_count: :integer, cell_size: v2] ++
        [row_stride: :integer, cell_stride: :integer] ++
        [fields: [{:object, name: :string, offset: :integer, type: types}], data: :bytes]
  }

  @doc """
  The names that there are.

      iex> "foxglove.Log" in Mcap.Foxglove.Schemas.names()
      true
  """
  @spec names() :: [String.t()]
  def names, do: @schemas |> Map.keys() |> Enum.sort()

  @doc "The text of a schema. Raises `ArgumentError` for a name that there is not."
  @spec text(String.t()) :: String.t()
  def text(name) do
    case @schemas do
      %{^name => fields} ->
        {:object, pairs} = object(fields)
        Hal.Json.encode!({:object, [{"title", name} | pairs]})

      _other ->
        hint = Hal.Options.Suggest.hint("#{name}", names())

        raise ArgumentError,
              "no schema #{inspect(name)}: there are #{Enum.join(names(), ", ")}#{hint}"
    end
  end

  defp schema({:object, fields}), do: object(fields)
  defp schema([item]), do: {:object, [{"type", "array"}, {"items", schema(item)}]}

  defp schema({:choice, values}) do
    {:object,
     [{"oneOf", for({title, n} <- values, do: {:object, [{"title", title}, {"const", n}]})}]}
  end

  defp schema(:time) do
    {:object, pairs} = object(sec: :natural, nsec: :natural)
    {:object, [{"title", "time"} | pairs]}
  end

  defp schema(:natural), do: {:object, [{"type", "integer"}, {"minimum", 0}]}
  defp schema(:bytes), do: {:object, [{"type", "string"}, {"contentEncoding", "base64"}]}
  defp schema(type), do: {:object, [{"type", type}]}

  defp object(fields) do
    properties = for {key, type} <- fields, do: {Atom.to_string(key), schema(type)}
    {:object, [{"type", "object"}, {"properties", {:object, properties}}]}
  end
end
