defmodule Sim.Compute.Palette do
  @moduledoc false
  # Lists the colours of simulated objects: their paint, the colour class they match, and the relation of their blobs to
  # distance. Pure.

  @enforce_keys [:name, :paint, :rgb, :thresholds, :constant]
  defstruct @enforce_keys

  @type kind :: :landmark | :robot
  @type t :: %__MODULE__{
          name: String.t(),
          paint: {y :: byte(), u :: byte(), v :: byte()},
          rgb: {byte(), byte(), byte()},
          thresholds: {{byte(), byte()}, {byte(), byte()}, {byte(), byte()}},
          constant: float()
        }

  # A pole of 0.3 x 1 m at 1 m would fill 0.3 of the picture, but its dark edges are lost.
  @landmark_constant 0.25
  @robot_constant 0.2
  @landmark_luma 170
  @robot_luma 30

  @doc """
  The colour of a kind of thing.

      iex> Sim.Compute.Palette.of(:landmark).name
      "YellowLandmark"
  """
  @spec of(kind()) :: t()
  def of(:landmark) do
    %__MODULE__{
      name: "YellowLandmark",
      paint: {205, 75, 137},
      rgb: {218, 216, 111},
      thresholds: {{@landmark_luma, 240}, {60, 90}, {130, 145}},
      constant: @landmark_constant
    }
  end

  def of(:robot) do
    %__MODULE__{
      name: "RedRobot",
      paint: {100, 100, 210},
      rgb: {215, 51, 50},
      thresholds: {{@robot_luma, 160}, {80, 122}, {165, 240}},
      constant: @robot_constant
    }
  end

  @kinds [:landmark, :robot]

  @doc """
  The number of a kind in packed arguments, and the kind of a number.

      iex> Sim.Compute.Palette.kind(Sim.Compute.Palette.index(:robot))
      :robot
  """
  @spec index(kind()) :: byte()
  def index(:landmark), do: 0
  def index(:robot), do: 1

  @doc "See `index/1`."
  @spec kind(byte()) :: kind()
  def kind(0), do: :landmark
  def kind(1), do: :robot

  @doc "The lowest brightness at which a kind is still found."
  @spec least_luma(kind()) :: byte()
  def least_luma(:landmark), do: @landmark_luma
  def least_luma(:robot), do: @robot_luma

  @doc """
  All colours, for the blob finder.

      iex> Enum.map(Sim.Compute.Palette.colours().classes, & &1.name)
      ["YellowLandmark", "RedRobot"]
  """
  @spec colours() :: Vision.Colours.t()
  def colours do
    classes =
      for kind <- @kinds,
          %{thresholds: {y, u, v}} = paint = of(kind),
          do: %{name: paint.name, rgb: paint.rgb, y: y, u: u, v: v}

    distances = Map.new(@kinds, &{of(&1).name, of(&1).constant})
    {:ok, colours} = Vision.Colours.new(classes, distance: distances)
    colours
  end

  @doc """
  The distance, computed from the share of the picture that a blob fills; `nil` if it fills more
  than half.

      iex> Sim.Compute.Palette.distance(:landmark, 0.6)
      nil
  """
  @spec distance(kind(), float()) :: float() | nil
  def distance(kind, share), do: Vision.distance(of(kind).constant, share)
end
