defmodule Hal.RFlex.Sensors.IndexSwitch do
  @moduledoc false
  # Reads the switch that some bases (B21r) close at one absolute heading, as a digital input. Pure.
  #
  # It closes over a small angle: its first event records the heading, and a later one more than
  # 0.01 rad away makes the larger of the two the home heading. Older drivers then count all
  # headings from there; here odometry does not jump, and the home heading is a reading of its own.
  # The robot does not turn to look for it.
  alias Hal.Pose

  @apart 0.01

  defstruct first: nil, heading: nil

  @type t :: %__MODULE__{first: float() | nil, heading: float() | nil}

  @doc """
  Takes an event of the switch at this heading of the odometry, in radians.

      iex> alias Hal.RFlex.Sensors.IndexSwitch
      iex> home = %IndexSwitch{} |> IndexSwitch.event(1.0) |> IndexSwitch.event(1.005)
      iex> home.heading
      nil
      iex> IndexSwitch.event(home, 1.1).heading
      1.1
  """
  @spec event(t(), float()) :: t()
  def event(%__MODULE__{first: nil} = home, heading), do: %{home | first: heading}

  def event(%__MODULE__{heading: nil, first: first} = home, heading) do
    apart = Pose.wrap(heading - first)

    cond do
      abs(apart) <= @apart -> home
      apart > 0 -> %{home | heading: heading}
      true -> %{home | heading: first}
    end
  end

  def event(%__MODULE__{} = home, _heading), do: home
end
