defmodule Sim.World.Object do
  @moduledoc """
  Describes a ball or a box that robots can push: low and light. Pure.

  It is lower than the beams of sonars and lidars, and lighter than what closes a bumper. So sonars, lidars, infrared sensors and
  bumpers do not notice it, and only cameras do. No rule of a robot's gate is relaxed for it. Touching one is no collision.

  A ball is painted as an upright cylinder as wide and as high as it is, a box as what it is. Both stand on the floor, so the
  lowest row of their blob tells how far they are.
  """
  alias Hal.{Options, Pose}
  alias Sim.Floorplan
  alias Sim.World.Contact

  @table [
    id: [{:text, "a name"}, required: true],
    kind: [{:one_of, [:ball, :box]}, required: true],
    pose: [{:struct, Pose}, required: true],
    radius: [{:number, 0.03, 1.0, "m"}, default: 0.11],
    length: [{:number, 0.1, 5.0, "m"}, default: 1.2],
    width: [{:number, 0.1, 5.0, "m"}, default: 0.4],
    height: [{:number, 0.05, 1.0, "m"}, default: 0.25]
  ]

  @enforce_keys [:id, :kind, :pose, :size, :height]
  defstruct @enforce_keys ++ [velocity: {0.0, 0.0}]

  @typedoc "Sizes in metres; the length of a box is along its heading. `velocity` is that of a ball that rolls, in m/s."
  @type t :: %__MODULE__{
          id: String.t(),
          kind: :ball | :box,
          pose: Pose.t(),
          size: radius :: float() | {length :: float(), width :: float()},
          height: float(),
          velocity: {float(), float()}
        }

  @doc """
  An object at rest, of keys and values: `id`, `kind`, `pose`, and `radius` of a ball, `length`, `width` and `height` of a box. Wrong
  ones raise `ArgumentError`.

      iex> ball = Sim.World.Object.new!(id: "ball1", kind: :ball, pose: Hal.Pose.new(1, 0))
      iex> {Sim.World.Object.colour(ball), ball.size, ball.height}
      {"OrangeBall", 0.11, 0.22}
  """
  @spec new!(keyword()) :: t()
  def new!(options) do
    given = options |> Options.check!(@table, "object") |> Map.new()

    {size, height} =
      if given.kind == :ball,
        do: {given.radius, 2 * given.radius},
        else: {{given.length, given.width}, given.height}

    %__MODULE__{id: given.id, kind: given.kind, pose: given.pose, size: size, height: height}
  end

  @doc "The name of its colour."
  @spec colour(t()) :: String.t()
  def colour(%__MODULE__{kind: kind}), do: Sim.Compute.Palette.of(kind).name

  @doc "The corners of a box, in the frame of the world; none of a ball."
  @spec corners(t()) :: [Pose.point()]
  def corners(%__MODULE__{kind: :ball}), do: []

  def corners(%__MODULE__{pose: pose, size: {length, width}}) do
    for {along, across} <- [{1, 1}, {-1, 1}, {-1, -1}, {1, -1}],
        do: Pose.place(pose, {along * length / 2, across * width / 2})
  end

  @doc "It as viewers are shown it (`t:Sim.Scene.thing/0`)."
  @spec thing(t()) :: Sim.Scene.thing()
  def thing(%__MODULE__{id: id, kind: kind, pose: pose, size: size, height: height} = object) do
    radius = if kind == :ball, do: size

    %{
      id: id,
      kind: kind,
      pose: pose,
      radius: radius,
      corners: corners(object),
      size: size,
      height: height
    }
  end

  @doc "It as cameras see it (`Sim.Compute.CameraFrustum`)."
  @spec pole(t()) :: Sim.Compute.CameraFrustum.pole()
  def pole(%__MODULE__{kind: :ball, pose: %{x: x, y: y}, size: radius, height: height}),
    do: {x, y, radius, height, :ball}

  def pole(%__MODULE__{kind: :box, pose: pose, size: {length, width}, height: height}),
    do: {pose, {length / 2, width / 2}, height, :box}

  @doc "The discs that fill it but for the corners of a box; no two middles are further apart than a quarter of its lesser side."
  @spec discs(t()) :: [Contact.disc()]
  def discs(%__MODULE__{kind: :ball, pose: %{x: x, y: y}, size: radius}), do: [{x, y, radius}]

  def discs(%__MODULE__{kind: :box, pose: pose, size: {length, width}}) do
    {long, short} = {max(length, width), min(length, width)}
    count = max(ceil((long - short) / (short / 4)), 1)

    for k <- 0..count do
      at = (short - long) / 2 + k * (long - short) / count
      {x, y} = Pose.place(pose, if(length >= width, do: {at, 0.0}, else: {0.0, at}))
      {x, y, short / 2}
    end
  end

  @doc """
  How far a disc is from it, edge to edge, negative where they overlap; the direction from the disc to it, of length 1; and where
  they touch, or would.

      iex> box = Sim.World.Object.new!(id: "box1", kind: :box, pose: Hal.Pose.new(1, 0))
      iex> {gap, {x, y}, {_px, _py}} = Sim.World.Object.gap(box, {0.0, 0.0, 0.3})
      iex> {Float.round(gap, 6), x, y}
      {0.1, 1.0, 0.0}
  """
  @spec gap(t(), Contact.disc()) ::
          {metres :: float(), direction :: {float(), float()}, nearest :: Pose.point()}
  def gap(%__MODULE__{kind: :ball, pose: %{x: x, y: y}, size: r}, {dx, dy, dr} = disc) do
    {nx, ny} = unit(x - dx, y - dy)
    {Contact.gap(disc, {x, y, r}), {nx, ny}, {dx + dr * nx, dy + dr * ny}}
  end

  def gap(%__MODULE__{kind: :box, pose: pose, size: {length, width}}, {dx, dy, dr}) do
    {half_x, half_y} = {length / 2, width / 2}
    %{x: x, y: y} = Pose.relative(pose, Pose.new(dx, dy))
    {nx, ny} = {clamp(x, half_x), clamp(y, half_y)}

    # The middle of the disc is outside, or in the box; then the nearest side counts.
    {distance, {px, py}} =
      cond do
        {nx, ny} != {x, y} -> {Pose.distance({x, y}, {nx, ny}), {nx, ny}}
        half_x - abs(x) < half_y - abs(y) -> {abs(x) - half_x, {sign(x) * half_x, y}}
        true -> {abs(y) - half_y, {x, sign(y) * half_y}}
      end

    {ux, uy} = if distance >= 0.0, do: unit(px - x, py - y), else: unit(x - px, y - py)
    {c, s} = Sim.Trig.cos_sin(pose.heading)
    {distance - dr, {ux * c - uy * s, ux * s + uy * c}, Pose.place(pose, {px, py})}
  end

  @doc "Whether it stands free of the walls."
  @spec free?(t(), Floorplan.t()) :: boolean()
  def free?(%__MODULE__{} = object, map) do
    Enum.all?(discs(object), fn {x, y, r} -> Floorplan.free?(map, {x, y}, r) end) and
      Enum.all?(corners(object), &(not Floorplan.wall?(map, &1)))
  end

  defp clamp(value, most), do: value |> max(-most) |> min(most)
  defp sign(value), do: if(value < 0.0, do: -1.0, else: 1.0)

  defp unit(x, y) do
    length = :math.sqrt(x * x + y * y)
    if length > 0.0, do: {x / length, y / length}, else: {1.0, 0.0}
  end
end
