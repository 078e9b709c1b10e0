defmodule Sim.Compute.Palette do
  @moduledoc false
  # Lists the colours of simulated objects: their paint, the colour class they match, and the relation of their blobs to
  # distance. Pure.

  @enforce_keys [:name, :paint, :rgb, :thresholds, :constant]
  defstruct @enforce_keys

  @type kind :: :landmark | :robot | :ball | :box
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
  # A ball of 0.22 m, as the pole of 0.3 x 1 m; a box of 1.2 x 0.25 m whose flank is seen.
  @ball_constant 0.04
  @box_constant 0.25
  @landmark_luma 170
  @robot_luma 30
  @ball_luma 60
  @box_luma 40

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

  def of(:ball) do
    %__MODULE__{
      name: "OrangeBall",
      paint: {150, 50, 178},
      rgb: {228, 120, 20},
      thresholds: {{@ball_luma, 200}, {40, 76}, {152, 190}},
      constant: @ball_constant
    }
  end

  def of(:box) do
    %__MODULE__{
      name: "BlueBox",
      paint: {90, 200, 100},
      rgb: {30, 80, 230},
      thresholds: {{@box_luma, 160}, {165, 225}, {80, 120}},
      constant: @box_constant
    }
  end

  @kinds [:landmark, :robot, :ball, :box]

  @doc "All kinds, in the order of the blob finder."
  @spec kinds() :: [kind()]
  def kinds, do: @kinds

  @doc """
  The number of a kind in packed arguments, and the kind of a number.

      iex> Sim.Compute.Palette.kind(Sim.Compute.Palette.index(:robot))
      :robot
  """
  @spec index(kind()) :: byte()
  def index(:landmark), do: 0
  def index(:robot), do: 1
  def index(:ball), do: 2
  def index(:box), do: 3

  @doc "See `index/1`."
  @spec kind(byte()) :: kind()
  def kind(0), do: :landmark
  def kind(1), do: :robot
  def kind(2), do: :ball
  def kind(3), do: :box

  @doc "The lowest brightness at which a kind is still found."
  @spec least_luma(kind()) :: byte()
  def least_luma(:landmark), do: @landmark_luma
  def least_luma(:robot), do: @robot_luma
  def least_luma(:ball), do: @ball_luma
  def least_luma(:box), do: @box_luma

  @doc """
  All colours, for the blob finder.

      iex> Enum.map(Sim.Compute.Palette.colours().classes, & &1.name)
      ["YellowLandmark", "RedRobot", "OrangeBall", "BlueBox"]
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
