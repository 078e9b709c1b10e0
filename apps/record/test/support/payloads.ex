defmodule Mcap.Payloads do
  @moduledoc "One payload of each of Foxglove's kinds, with all that it can have."
  alias Mcap.Foxglove
  alias Mcap.Foxglove.Scene

  @doc "`{name of the schema, payload}`."
  @spec all(non_neg_integer()) :: [{String.t(), iodata()}]
  def all(ns) do
    pose = Hal.Pose.new(1.25, -2, 0.5)
    high = {{1, 2, 3.5}, {0, 0, 0.6, 0.8}}
    blue = {0, 0.25, 1}

    bodies = [
      Scene.cylinder(pose, {0.4, 0.4, 0.3}, blue),
      Scene.cylinder(pose, {0.4, 0.4, 0.3}, blue, {1, 0.5}),
      Scene.cube(high, {1, 1, 1}, {1, 0, 0, 0.5}),
      Scene.sphere({{0, 0, 1}, 0}, {1, 1, 1}, blue),
      Scene.arrow(pose, {0.4, 0.05, 0.1, 0.1}, blue),
      Scene.line([{0, 0}, {1, 1, 0.1}], 2, blue, kind: :loop, pixels: true),
      Scene.line([], 0.1, blue),
      Scene.text({{1, 2, 1}, 0}, "mag1 \"the\nfirst\"", 0.3, {1, 1, 1})
    ]

    robot =
      Scene.entity(ns, "map", "mag1", bodies, lifetime_ns: 1_500_000_000, metadata: [{"a", "b"}])

    moved = [Scene.delete(ns, "min1"), Scene.delete_all(ns)]

    grid = %{
      pose: pose,
      columns: 2,
      cell_size: {0.5, 0.5},
      row_stride: 2,
      cell_stride: 1,
      fields: [{"occupancy", 0, :u8}],
      data: <<0, 255, 128, 1>>
    }

    [
      {"foxglove.FrameTransforms",
       Foxglove.frame_transforms(ns, [{"map", "mag1", pose}, {"mag1", "camera", high}])},
      {"foxglove.FrameTransforms", Foxglove.frame_transforms(ns, [])},
      {"foxglove.PoseInFrame", Foxglove.pose_in_frame(ns, "map", pose)},
      {"foxglove.PosesInFrame", Foxglove.poses_in_frame(ns, "map", [pose, high])},
      {"foxglove.SceneUpdate", Foxglove.scene_update([robot], moved)},
      {"foxglove.SceneUpdate", Foxglove.scene_update([Scene.entity(ns, "map", "empty", [])])},
      {"foxglove.CompressedImage", Foxglove.compressed_image(ns, "camera", <<0xFF, 0xD8, 0>>)},
      {"foxglove.ImageAnnotations", Foxglove.image_boxes(ns, [], blue)},
      {"foxglove.ImageAnnotations",
       Foxglove.image_boxes(ns, [{{1, 2, 10.5, 20}, "Red"}, {{3, 4, 5, 6}, ""}], blue)},
      {"foxglove.Log", Foxglove.log(ns, :warning, "mag1", "said \"ü\" and \t" <> <<0xFF>>)},
      {"foxglove.Grid", Foxglove.grid(ns, "map", grid)}
    ]
  end
end
