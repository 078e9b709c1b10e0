defmodule Sim.Device.Camera do
  @moduledoc """
  Simulates the camera of a robot in a simulated world. It paints its pictures in its own process, from what the server
  sends: the static ground once, and then what moves (`Sim.World.CameraView`). Options: `world`, `robot` as for
  `Sim.Device.Drive`; `clock`, the robot's clock, which gives pictures their time; `blobs: :direct` for a camera that
  computes blobs by geometry and never paints: for many robots on few processors.
  """
  @behaviour Hal.Camera
  alias Sim.World
  alias Sim.World.CameraView

  @impl Hal.Camera
  def init(options) do
    options =
      Keyword.validate!(options, [
        :world,
        :robot,
        blobs: :painted,
        clock: {System, :monotonic_time, [:millisecond]}
      ])

    with {:ok, line} <- World.Server.attach(options[:world], options[:robot], :camera) do
      camera = Map.new(Keyword.take(options, [:robot, :blobs, :clock]))
      {:ok, Map.merge(camera, %{line: line, ground: nil})}
    end
  end

  @impl Hal.Camera
  def explain(:no_world, options),
    do: "its simulated world #{inspect(options[:world])} is not there"

  def explain(:no_ground, _options), do: "what stands still in its world was lost on the way"
  def explain(:mute, _options), do: "its world sends no view"
  def explain(reason, _options), do: inspect(reason)

  @impl Hal.Camera
  def next(%{line: {server, _}} = camera) do
    World.Server.next(server, camera.robot)
    {:ok, camera}
  end

  @impl Hal.Camera
  def handle_message({:world, server, {:ground, ground}}, %{line: {server, _}} = camera),
    do: {:ok, [], %{camera | ground: ground}}

  # The ground was lost on its way: the next attachment brings it.
  def handle_message(
        {:world, server, {:view, _moving}},
        %{line: {server, _}, ground: nil} = camera
      ),
      do: {:error, :no_ground, camera}

  def handle_message({:world, server, {:view, moving}}, %{line: {server, _}} = camera),
    do: {:ok, [see(CameraView.world(camera.ground, moving, camera.robot), camera)], camera}

  def handle_message({:world, server, {:error, reason}}, %{line: {server, _}} = camera),
    do: {:error, reason, camera}

  def handle_message({:DOWN, monitor, _, _, _}, %{line: {_, monitor}} = camera),
    do: {:error, :no_world, camera}

  def handle_message(_other, camera), do: {:ok, [], camera}

  @impl Hal.Camera
  def terminate(camera), do: World.Server.detach(camera.line, camera.robot, :camera)

  defp see(world, %{clock: {m, f, a}, robot: robot} = camera) do
    at_ms = apply(m, f, a)

    case camera.blobs do
      :painted ->
        {:frame, %{World.frame(world, robot) | at_ms: at_ms}}

      :direct ->
        {:detections, timed(World.detections(world, robot), at_ms)}
    end
  end

  defp timed(%{marks: marks} = detections, at_ms) do
    marks = marks && for mark <- marks, do: %{mark | at_ms: at_ms}
    %{detections | at_ms: at_ms, marks: marks}
  end
end
