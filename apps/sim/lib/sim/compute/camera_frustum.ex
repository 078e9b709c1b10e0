defmodule Sim.Compute.CameraFrustum do
  @moduledoc false
  # Places a robot's camera, and tells what its picture can contain. Pure.
  #
  # A pinhole camera above the robot's centre. Tilt moves the horizon as if the film were shifted,
  # so that vertical edges stay columns. Pixel centres lie at whole numbers.
  alias Sim.Trig

  @enforce_keys [:x, :y, :cosine, :sine, :eye, :focal, :horizon, :width, :height]
  defstruct @enforce_keys

  @type t :: %__MODULE__{
          x: float(),
          y: float(),
          cosine: float(),
          sine: float(),
          eye: float(),
          focal: float(),
          horizon: float(),
          width: pos_integer(),
          height: pos_integer()
        }

  @typedoc "Something upright and round: place, radius, height, and what it is; or a box: pose, half its length and width, height."
  @type pole ::
          {float(), float(), radius :: float(), height :: float(), Sim.Compute.Palette.kind()}
          | {Hal.Pose.t(), {half_x :: float(), half_y :: float()}, height :: float(),
             Sim.Compute.Palette.kind()}

  @doc "The camera of a body of a world, with pictures of the profile's size."
  @spec of(Sim.World.Body.t()) :: t()
  def of(%{pose: pose, profile: %{camera: camera}} = body) do
    {c, s} = Trig.cos_sin(pose.heading + body.pan)
    focal = camera.width / 2 / Trig.tan(body.field_of_view / 2)

    %__MODULE__{
      x: pose.x,
      y: pose.y,
      cosine: c,
      sine: s,
      eye: camera.mount_height * 1.0,
      focal: focal,
      horizon: (camera.height - 1) / 2 + focal * Trig.tan(body.tilt),
      width: camera.width,
      height: camera.height
    }
  end
end
