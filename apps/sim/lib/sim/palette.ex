defmodule Sim.Palette do
  @moduledoc """
  The colours of the simulated things: what they are painted with, what the blob finder
  takes them for, and what their blobs say about distance. Pure.
  """

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

  # A pole of 0.3 x 1 m at 1 m would fill 0.3 of the picture; its dark edges are lost (R43).
  @landmark_constant 0.25
  @robot_constant 0.2

  @doc """
  The colour of a kind of thing.

      iex> Sim.Palette.of(:landmark).name
      "YellowLandmark"
  """
  @spec of(kind()) :: t()
  def of(:landmark) do
    %__MODULE__{
      name: "YellowLandmark",
      paint: {205, 75, 137},
      rgb: {218, 216, 111},
      thresholds: {{170, 240}, {60, 90}, {130, 145}},
      constant: @landmark_constant
    }
  end

  def of(:robot) do
    %__MODULE__{
      name: "RedRobot",
      paint: {100, 100, 210},
      rgb: {215, 51, 50},
      thresholds: {{30, 160}, {80, 122}, {165, 240}},
      constant: @robot_constant
    }
  end

  @doc "The demo's colour file in CMVision's format."
  @spec file() :: String.t()
  def file do
    kinds = Enum.map([:landmark, :robot], &of/1)

    colours = for %{rgb: {r, g, b}, name: name} <- kinds, do: "(#{r},#{g},#{b}) 0.5 10 #{name}\n"

    thresholds =
      for %{thresholds: {{yl, yh}, {ul, uh}, {vl, vh}}} <- kinds,
          do: "(#{yl}:#{yh},#{ul}:#{uh},#{vl}:#{vh})\n"

    IO.iodata_to_binary(["[Colors]\n", colours, "\n[Thresholds]\n", thresholds])
  end

  @doc """
  Distance from the share of the picture that a blob fills; `nil` where it fills more than half.

      iex> Sim.Palette.distance(:landmark, 0.6)
      nil
  """
  @spec distance(kind(), float()) :: float() | nil
  def distance(_kind, share) when share > 0.5, do: nil
  def distance(kind, share), do: :math.sqrt(of(kind).constant / share)
end
