defmodule Sim.World.Mark do
  @moduledoc """
  Describes a printed mark with an id that hangs in a world: flat and upright, one side printed. Pure.

  An AprilTag needs libapriltag, which knows the pictures of the ids (`Vision.Marks.available/1`). It is no obstacle. Hang it a little
  before its wall: what is in the wall is hidden. A robot may bear one on its back.
  """
  alias Hal.{Options, Pose}
  alias Vision.Marks

  @table [
    family: [{:one_of, Marks.families()}, default: :tag36h11],
    id: [{:integer, 0, 65_535}, required: true],
    size: [{:number, 0.01, 10.0, "m"}, default: 0.16],
    pose: [{:struct, Pose}, default: nil],
    robot: [{:check, &is_atom/1, "a robot of the world"}, default: nil],
    height: [{:number, 0.0, 100.0, "m"}, default: 0.3]
  ]

  # So far behind its back, lest its own body hides it (metres).
  @before 0.02

  @enforce_keys Keyword.keys(@table) ++ [:packed]
  defstruct @enforce_keys

  @typedoc "`pose` is the place of its middle, and where it faces, `nil` of one on the back of a `robot`; `height` that of its middle; `size` the side of its square, in metres."
  @type t :: %__MODULE__{
          family: Vision.Mark.family(),
          id: non_neg_integer(),
          size: float(),
          pose: Pose.t() | nil,
          robot: atom(),
          height: float(),
          packed: Sim.Compute.Marks.packed()
        }

  @doc "A mark, of keys and values. Wrong ones, and a missing library, raise `ArgumentError`."
  @spec new!(keyword()) :: t()
  def new!(options) do
    options = Options.check!(options, @table, "mark")
    with {:error, line} <- Marks.available(options[:family]), do: raise(ArgumentError, line)

    case Marks.picture(options[:family], options[:id]) do
      nil ->
        raise ArgumentError, "mark option id: #{options[:family]} has no mark #{options[:id]}"

      picture ->
        painted!(options, picture)
    end
  end

  @doc "The same with another picture (`Vision.Marks.picture/2`) than that of its id."
  @spec painted!(keyword(), Marks.Picture.t()) :: t()
  def painted!(options, picture) do
    mark = options |> Options.check!(@table, "mark") |> Map.new()
    struct!(__MODULE__, Map.put(mark, :packed, packed(mark, picture)))
  end

  @doc "The mark on the back of a robot that is there, and of this radius (metres); another one as it is."
  @spec borne(t(), (robot :: atom() -> {Pose.t(), radius :: float()})) :: t()
  def borne(%__MODULE__{robot: nil} = mark, _where), do: mark

  def borne(%__MODULE__{robot: robot, packed: packed} = mark, where) do
    {pose, radius} = where.(robot)
    pose = Pose.compose(pose, Pose.new(-radius - @before, 0.0, :math.pi()))
    {cosine, sine} = Sim.Trig.cos_sin(pose.heading)
    {_x, _y, _cosine, _sine, height, row, rows, edges, white} = packed
    %{mark | pose: pose, packed: {pose.x, pose.y, cosine, sine, height, row, rows, edges, white}}
  end

  defp packed(%{pose: pose, size: size} = mark, picture) do
    pose = pose || Pose.new(0.0, 0.0)
    {cosine, sine} = Sim.Trig.cos_sin(pose.heading)
    edges = for edge <- picture.edges, into: <<>>, do: <<edge * size::float-native>>

    {pose.x, pose.y, cosine, sine, mark.height * 1.0, picture.row * size, picture.rows, edges,
     picture.white}
  end
end
