defmodule Bench.Mesh.IdleDrive do
  @moduledoc false
  # Stands in for a drive without a world: its wheels stand still and report that ten times a second. Its sonars report,
  # but see nothing.
  @behaviour Hal.Drive
  alias Hal.{Odometry, Pose, Twist}

  @period_ms 100

  @impl Hal.Drive
  def init(_options) do
    {:ok, _timer} = :timer.send_interval(@period_ms, :stand)
    {:ok, nil}
  end

  @impl Hal.Drive
  def drive(_twist, s), do: {:ok, s}

  @impl Hal.Drive
  def handle_message(:stand, s) do
    odometry = %Odometry{pose: Pose.new(0, 0), twist: Twist.zero()}
    {:ok, [{:odometry, odometry}, {:report, :sonar}], s}
  end

  def handle_message(_other, s), do: {:ok, [], s}

  @impl Hal.Drive
  def terminate(_s), do: :ok
end
