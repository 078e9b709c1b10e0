defmodule Hal.RFlex.Conversions do
  @moduledoc """
  Holds a robot's conversions between the controller's units and ours. They differ between robots of one model by 7 %
  and more, so only the wheels' ratio has a default, and a robot that lacks one that it needs does not arm. Pure.

  | name | units |
  |---|---|
  | `distance` | per metre driven |
  | `angle` | per radian turned |
  | `range` | per metre of a sonar's range |
  | `wheel_ratio` | distance of the right wheel divided by that of the left one when the controller counts the same (`Hal.Drive.Wheels`); 1.0 unless given |
  | `ir_a`, `ir_b` | constants of each infrared's law, one number for all or a list (see `Hal.RFlex.Sensors.Infrared`) |

  Older drivers' files give distances per millimetre; multiply them by 1000.
  """

  defstruct distance: nil, angle: nil, wheel_ratio: 1.0, range: nil, ir_a: nil, ir_b: nil

  @type t :: %__MODULE__{
          distance: float() | nil,
          angle: float() | nil,
          wheel_ratio: float(),
          range: float() | nil,
          ir_a: float() | [float()] | nil,
          ir_b: float() | [float()] | nil
        }

  @words [
    distance: "distance (units per metre)",
    angle: "angle (units per radian)",
    range: "range (units per metre of sonar)",
    ir_a: "ir_a (infrared)",
    ir_b: "ir_b (infrared)"
  ]

  # From public configurations; a single robot's differ by 7 % and more.
  @published %{
    magellan: [distance: 31_387.0, angle: 4654.2],
    atrv_mini: [distance: 190_000.0, angle: 60_000.0]
  }
  @range 1474.0

  @doc """
  The published conversions of the wheels of such a body (`rflex` of `Hal.Profile`), to begin with; none of any other.

      iex> for rflex <- [:magellan, nil], do: Hal.RFlex.Conversions.published(rflex)
      [[distance: 31387.0, angle: 4654.2], []]
  """
  @spec published(:magellan | :atrv_mini | nil) :: [{:distance | :angle, float()}]
  def published(rflex), do: Map.get(@published, rflex, [])

  @doc "The published conversion of the sonars, in units per metre."
  @spec range() :: float()
  def range, do: @range

  @doc """
  Whether all conversions are present that a robot with these sensors needs; the error names the
  missing ones.

      iex> Hal.RFlex.Conversions.ready(%Hal.RFlex.Conversions{range: 1474.0}, [:sonar])
      {:error, "conversions are missing: distance (units per metre), angle (units per radian)"}
      iex> Hal.RFlex.Conversions.ready(%Hal.RFlex.Conversions{distance: 31387.0, angle: 4654.2}, [])
      :ok
  """
  @spec ready(t(), [:sonar | :infrared]) :: :ok | {:error, String.t()}
  def ready(%__MODULE__{} = conversions, senses) do
    needed =
      [:distance, :angle] ++
        if(:sonar in senses, do: [:range], else: []) ++
        if(:infrared in senses, do: [:ir_a, :ir_b], else: [])

    case for key <- needed, Map.fetch!(conversions, key) == nil, do: @words[key] do
      [] -> :ok
      missing -> {:error, "conversions are missing: #{Enum.join(missing, ", ")}"}
    end
  end
end
