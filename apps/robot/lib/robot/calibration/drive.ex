defmodule Robot.Calibration.Drive do
  @moduledoc """
  Runs the mission of a robot under calibration: it drives one course (`Robot.Calibration.DriveCourse`) and stands.
  Options: those of the course, whose legs `legs/1` gives. Its phase is `:driving`, then `:done` or `:blocked`. Pure.
  """
  @behaviour Robot.Mission
  alias Robot.Calibration.DriveCourse

  @doc """
  The legs of a distance (metres), of an angle (radians), or of a square with sides in metres,
  which ends with the heading of its start.

      iex> Robot.Calibration.Drive.legs({:distance, 3.0})
      [go: 3.0]
      iex> Robot.Calibration.Drive.legs({:square, :cw, 4.0}) |> length()
      8
  """
  @spec legs({:distance, float()} | {:angle, float()} | {:square, :cw | :ccw, float()}) ::
          [{:go, float()} | {:turn, float()}]
  def legs({:distance, way}), do: [go: way]
  def legs({:angle, turn}), do: [turn: turn]

  def legs({:square, direction, side}) do
    quarter = if direction == :cw, do: -:math.pi() / 2, else: :math.pi() / 2
    [go: side, turn: quarter] |> List.duplicate(4) |> List.flatten()
  end

  @impl Robot.Mission
  def init(_robot, options) do
    effects = [
      {:goal, :course, {DriveCourse, options}},
      {:look, 0.0},
      {:claim, %{phase: :idle, standing: false}}
    ]

    {:driving, :driving, effects}
  end

  @impl Robot.Mission
  def handle({:outcome, :course, outcome}, _phase) do
    phase = if outcome == 1, do: :done, else: :blocked
    {phase, phase, [{:goal, :idle, nil}, {:claim, %{phase: :idle, standing: true}}]}
  end

  def handle(_event, phase), do: {phase, phase, []}
end
