defmodule Sim.Sight do
  @moduledoc """
  What a camera sees: the geometry of its picture, column by column. Pure.

  A pinhole camera over the robot's centre; the horizon moves with the tilt as with a camera whose
  film is shifted, so that upright edges stay columns. Pixel centres lie at whole numbers.
  """
  alias Sim.Trig

  @enforce_keys [:x, :y, :cosine, :sine, :eye, :focal, :width, :height, :horizon]
  defstruct @enforce_keys

  @type t :: %__MODULE__{
          x: float(),
          y: float(),
          cosine: float(),
          sine: float(),
          eye: float(),
          focal: float(),
          width: pos_integer(),
          height: pos_integer(),
          horizon: float()
        }

  @typedoc "Something upright and round: place, radius, height, and what it is."
  @type pole :: {float(), float(), radius :: float(), height :: float(), kind :: term()}

  @doc "The camera of a body."
  @spec of(Sim.Body.t()) :: t()
  def of(%Sim.Body{pose: pose, profile: %{camera: camera}} = body) do
    {c, s} = Trig.cos_sin(pose.heading + body.pan)
    focal = camera.width / 2 / Trig.tan(camera.field_of_view / 2)

    %__MODULE__{
      x: pose.x,
      y: pose.y,
      cosine: c,
      sine: s,
      eye: camera.mount_height * 1.0,
      focal: focal,
      width: camera.width,
      height: camera.height,
      horizon: (camera.height - 1) / 2 + focal * Trig.tan(body.tilt)
    }
  end

  @doc "The direction of a column, one metre deep: `{dx, dy}`."
  @spec direction(t(), number()) :: {float(), float()}
  def direction(%__MODULE__{cosine: c, sine: s} = sight, column) do
    k = ((sight.width - 1) / 2 - column) / sight.focal
    {c - s * k, s + c * k}
  end

  @doc "The columns that a pole can cover, `nil` where it is not in the picture; wider than it is rather than narrower."
  @spec columns(t(), pole()) :: {non_neg_integer(), non_neg_integer()} | nil
  def columns(%__MODULE__{} = sight, {x, y, r, _height, _kind}) do
    dx = x - sight.x
    dy = y - sight.y
    depth = sight.cosine * dx + sight.sine * dy
    side = sight.cosine * dy - sight.sine * dx

    cond do
      depth <= -r ->
        nil

      depth <= 2 * r ->
        {0, sight.width - 1}

      true ->
        # The far corners of the square round it, seen at its near side.
        middle = (sight.width - 1) / 2
        left = middle - sight.focal * ((side + r) / (depth + sign(side + r) * -r))
        right = middle - sight.focal * ((side - r) / (depth + sign(side - r) * r))
        first = max(floor(left) - 1, 0)
        last = min(ceil(right) + 1, sight.width - 1)
        if first <= last, do: {first, last}
    end
  end

  defp sign(value) when value < 0.0, do: -1.0
  defp sign(_value), do: 1.0

  @doc "The depth at which a column's ray meets a pole, or `nil`."
  @spec meet(t(), {float(), float()}, pole()) :: float() | nil
  def meet(%__MODULE__{} = sight, {rx, ry}, {x, y, r, _height, _kind}) do
    mx = x - sight.x
    my = y - sight.y
    a = rx * rx + ry * ry
    b = mx * rx + my * ry
    under = b * b - a * (mx * mx + my * my - r * r)
    if b > 0.0 and under >= 0.0, do: max((b - :math.sqrt(under)) / a, 0.01)
  end

  @doc "The first and last row that something from the floor to `height` covers at this depth."
  @spec rows(t(), float(), float()) :: {integer(), integer()}
  def rows(%__MODULE__{} = sight, depth, height) do
    top = sight.horizon - sight.focal * (height - sight.eye) / depth
    bottom = sight.horizon + sight.focal * sight.eye / depth
    {max(ceil(top), 0), min(floor(bottom), sight.height - 1)}
  end

  # The lamp rides beside the camera, 12 degrees to its left.
  @lamp_cosine 0.9781476007338057
  @lamp_sine 0.20791169081775934

  @doc "How bright a pole is where a column's ray meets it: 1 where it faces the lamp, 0.6 and less turned away."
  @spec shade(t(), {float(), float()}, float(), pole()) :: float()
  def shade(%__MODULE__{} = sight, {rx, ry}, depth, {x, y, r, _height, _kind}) do
    nx = (sight.x + rx * depth - x) / r
    ny = (sight.y + ry * depth - y) / r
    length = :math.sqrt(rx * rx + ry * ry)
    lx = (ry * @lamp_sine - rx * @lamp_cosine) / length
    ly = (0.0 - rx * @lamp_sine - ry * @lamp_cosine) / length
    0.6 + 0.4 * (nx * lx + ny * ly)
  end
end
