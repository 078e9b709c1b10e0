defmodule Vision.Detections do
  @moduledoc """
  Holds what a detector found in one frame of a camera, and how that frame was taken. This one struct
  goes from the detector (`Vision.BlobDetector`, or a camera that detects by itself) through the
  robot's blackboard into the percept of its behaviours and its mission.

    * `at_ms` - when the frame was taken, in milliseconds by the robot's clock; it distinguishes
      the frames
    * `blobs` - the `Vision.Blob`s in the order of `Vision.blobs/4`; `[]` means that nothing was
      seen. Each of them has the size of the frame
    * `marks` - the `Vision.Mark`s by id; each says in which frame it was seen, because not every
      frame is searched (`Vision.Marks.Schedule`). `nil` if no marks are looked for
    * `pan`, `tilt` - where the camera looked then, relative to the robot's body: radians, left
      and up positive
    * `field_of_view` - the horizontal field of view then, in radians; `nil` if it is not known
    * `pose` - where the robot stood then, in the `map` frame. Detectors leave it `nil`, and
      `Robot.Localiser` fills it in

  A frame that was not read gives no `Vision.Detections` at all.
  """
  alias Hal.{Frame, Pose}

  @enforce_keys [:at_ms, :blobs]
  defstruct @enforce_keys ++ [marks: nil, pan: 0.0, tilt: 0.0, field_of_view: nil, pose: nil]

  @type t :: %__MODULE__{
          at_ms: integer(),
          blobs: [Vision.Blob.t()],
          marks: [Vision.Mark.t()] | nil,
          pan: float(),
          tilt: float(),
          field_of_view: float() | nil,
          pose: Pose.t() | nil
        }

  @doc """
  The detections of a frame in which these blobs, and perhaps marks, were found. A camera whose direction is not known
  is taken to look straight ahead.

      iex> {:ok, frame} = Hal.Frame.new(:yuyv, 2, 1, <<0, 0, 0, 0>>, 40)
      iex> detections = Vision.Detections.new(%{frame | pan: 0.5}, [])
      iex> {detections.at_ms, detections.pan, detections.tilt, detections.field_of_view}
      {40, 0.5, 0.0, nil}
  """
  @spec new(Frame.t(), [Vision.Blob.t()], [Vision.Mark.t()] | nil) :: t()
  def new(%Frame{} = frame, blobs, marks \\ nil) do
    %__MODULE__{
      at_ms: frame.at_ms,
      blobs: blobs,
      marks: marks,
      pan: frame.pan || 0.0,
      tilt: frame.tilt || 0.0,
      field_of_view: frame.field_of_view
    }
  end
end
