defmodule Sim.Compute do
  @moduledoc """
  Does the heavy work of a world: distance fields, sonar rays, camera pictures. It runs in C if the library was built,
  otherwise in Elixir; both give the same bits, because every operation is an addition, multiplication, division or
  square root of doubles in the same order.
  """
  alias Sim.Compute
  alias Sim.Compute.Reference
  alias Sim.Compute.Palette
  alias Sim.Compute.CameraFrustum

  @typedoc "What noise is drawn for; `nil` for none."
  @type noise :: {seed :: integer(), step :: integer(), robot :: non_neg_integer()} | nil

  @typedoc "A body: place and radius."
  @type disc :: {float(), float(), float()}

  @typedoc """
  One robot's sonars: the index of its own disc, its place, cosine and sine of its heading, limits
  of range, and for each sensor 12 doubles: place and the five directions of its cone.
  """
  @type ring ::
          {index :: non_neg_integer(), x :: float(), y :: float(), cosine :: float(),
           sine :: float(), least :: float(), most :: float(), geometry :: binary()}

  @typedoc """
  What a column of a picture shows of one pole: its rows and brightness.
  """
  @type piece ::
          {column :: non_neg_integer(), Palette.kind(), first :: non_neg_integer(),
           last :: non_neg_integer(), luma :: byte()}

  @typedoc """
  One robot's lidar: as a ring, but its geometry is its place and the directions of its rays, two doubles each.
  """
  @type lidar :: ring()

  # More robots than this may block a normal scheduler for too long.
  @few 32
  @few_scans 8

  @table 4096
  @widest 4096

  @doc "The field of a plan, one byte per cell, 0 free: see `Sim.Floorplan`."
  @spec field(binary(), pos_integer(), pos_integer()) :: binary()
  def field(walls, width, height) when byte_size(walls) == width * height,
    do: module().field(walls, width, height)

  @doc """
  The sonar ranges of all rings. Noise is N(0, 0.01 + 0.01 r), drawn by robot and sensor; the
  robot is each ring's own.
  """
  @spec sonar(Sim.Floorplan.t(), [disc()], [ring()], noise()) :: [[float()]]
  def sonar(map, discs, rings, noise) do
    sonar(module(), pack(map), packed(discs), rings, narrow(noise))
  end

  defp packed(discs) do
    for {x, y, r} <- discs,
        into: <<>>,
        do: <<x::float-native, y::float-native, r::float-native>>
  end

  defp sonar(Compute.Native, map, discs, rings, noise) when length(rings) <= @few,
    do: Compute.Native.sonar_few(map, discs, rings, noise)

  defp sonar(Compute.Native, map, discs, rings, noise),
    do: Compute.Native.sonar_many(map, discs, rings, noise)

  defp sonar(module, map, discs, rings, noise), do: module.sonar_few(map, discs, rings, noise)

  @doc """
  What all lidars measure, as `Hal.Scan` has it: a ray that meets nothing in its reach is silent. Noise is N(0, 0.7 %), at least of
  3 mm, and one ray in fifty is lost; drawn by robot and ray.
  """
  @spec scan(Sim.Floorplan.t(), [disc()], [lidar()], noise()) :: [binary()]
  def scan(map, discs, lidars, noise) do
    arguments = [pack(map), packed(discs), lidars, narrow(noise)]

    if module() == Compute.Native and length(lidars) > @few_scans,
      do: apply(Compute.Native, :scan_many, arguments),
      else: apply(module(), :scan_few, arguments)
  end

  @doc "The parts of poles that a camera sees, by columns from the left, the nearest first."
  @spec look(Sim.Floorplan.t(), CameraFrustum.t(), [CameraFrustum.pole()]) :: [piece()]
  def look(map, %CameraFrustum{} = sight, poles) do
    pieces = module().look(pack(map), pack(sight), pack(poles))

    for <<column::16-native, top::16-native, bottom::16-native, kind, luma <- pieces>>,
      do: {column, Palette.kind(kind), top, bottom, luma}
  end

  @least for kind <- Palette.kinds(), into: <<>>, do: <<Palette.least_luma(kind)>>

  @doc "What a camera sees of poles (or of `pack/1` of them), joined to regions where parts of one kind touch, dark ones left out."
  @spec regions(Sim.Floorplan.t(), CameraFrustum.t(), [CameraFrustum.pole()] | binary()) ::
          [Compute.Regions.t()]
  def regions(map, %CameraFrustum{} = sight, poles) do
    module = module()
    map |> pack() |> module.look(pack(sight), pack(poles)) |> module.join(@least)
  end

  @doc """
  The bytes of an I420 picture. Noise is N(0, 3) for luma, N(0, 2) for chroma, and salt: one luma in
  a thousand is white or black. Marks are flat, stand upright, and hide each other by their distance.
  """
  @spec paint(
          Sim.Floorplan.t(),
          CameraFrustum.t(),
          [CameraFrustum.pole()] | binary(),
          [Sim.Compute.Marks.packed()],
          noise()
        ) :: binary()
  def paint(map, %CameraFrustum{} = sight, poles, marks, noise) do
    marks = Compute.Marks.sort(marks, {sight.x, sight.y})
    module().paint(pack(map), pack(sight), pack(poles), marks, narrow(noise), tables())
  end

  # A picture's noise: sd 3 for luma, 2 for chroma. A row starts anywhere in the first @table draws.
  @tables (for {sd, use} <- [{3, 0}, {2, 1}], k <- 0..(@table + @widest - 1), into: <<>> do
             <<round(sd * Sim.Noise.gauss(Sim.Noise.hash(0, 0x9A17, use, rem(k, @table))))::8-signed>>
           end)

  @doc "The noise draws for pictures, as `paint` takes them."
  @spec tables() :: binary()
  def tables, do: @tables

  @doc "The arguments in the form that the kernels take."
  @spec pack(Sim.Floorplan.t() | CameraFrustum.t() | [CameraFrustum.pole()] | binary()) ::
          tuple() | binary()
  def pack(%{field: field, width: width, height: height, cell: cell}),
    do: {field, width, height, cell}

  def pack(%CameraFrustum{} = s),
    do: {s.x, s.y, s.cosine, s.sine, s.eye, s.focal, s.horizon, s.width, s.height}

  def pack(packed) when is_binary(packed), do: packed

  def pack(poles) when is_list(poles), do: for(pole <- poles, into: <<>>, do: pole(pole))

  defp pole({x, y, r, height, kind}), do: pole({x, y, r, height}, {0.0, 0.0, 0.0, 0.0}, kind)

  defp pole({%{x: x, y: y, heading: heading}, {half_x, half_y}, height, kind}) do
    {c, s} = Sim.Trig.cos_sin(heading)
    round = :math.sqrt(half_x * half_x + half_y * half_y)
    pole({x, y, round, height}, {half_x, half_y, c, s}, kind)
  end

  defp pole({x, y, r, height}, {half_x, half_y, c, s}, kind) do
    %{paint: {luma, u, v}} = Palette.of(kind)

    <<x::float-native, y::float-native, r::float-native, height::float-native,
      half_x::float-native, half_y::float-native, c::float-native, s::float-native,
      Palette.index(kind), luma, u, v>>
  end

  defp narrow(nil), do: nil

  defp narrow({seed, step, robot}) do
    import Bitwise
    {seed &&& 0xFFFFFFFF, step &&& 0xFFFFFFFF, robot}
  end

  defp module, do: if(Compute.Native.loaded?(), do: Compute.Native, else: Reference)
end
