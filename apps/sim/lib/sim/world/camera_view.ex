defmodule Sim.World.CameraView do
  @moduledoc """
  Describes what a camera needs to know about a world, in two parts: the static ground, sent once, and what
  moves, a few numbers per robot. Pure.

  The map is most of a world's size. A hundred cameras look ten times a second, and some of them
  from another process of the operating system.
  """
  alias Hal.Pose
  alias Sim.World
  alias Sim.World.Body

  @typedoc """
  A world without what this camera does not need; `World.frame/2` and `World.detections/2` work
  for its robot.
  """
  @type ground :: World.t()

  @typedoc "Step, time, landmark, balls and boxes, poses in the order of the fleet; pan, tilt and field of view of the robot's camera."
  @type moving ::
          {step :: non_neg_integer(), at_ms :: integer(), Pose.point() | nil, [World.Object.t()],
           [{float(), float(), float()}],
           {pan :: float(), tilt :: float(), field_of_view :: float()}}

  @doc "The static part of the world for the camera of robot `id`."
  @spec ground(World.t(), World.id()) :: ground()
  def ground(%World{} = world, id) do
    robots = Map.new(world.robots, fn {other, body} -> {other, slim(body, other == id)} end)
    %{world | robots: robots, together: MapSet.new()}
  end

  @doc "The poses of all robots, to be reused for each camera."
  @spec poses(World.t()) :: [{float(), float(), float()}]
  def poses(%World{} = world) do
    for id <- world.order, %Pose{x: x, y: y, heading: heading} = World.truth(world, id) do
      {x, y, heading}
    end
  end

  @doc "The moving part for the camera of robot `id`, with the `poses/1` of all."
  @spec moving(World.t(), [{float(), float(), float()}], World.id()) :: moving()
  def moving(%World{} = world, poses, id) do
    %Body{pan: pan, tilt: tilt, field_of_view: angle} = Map.fetch!(world.robots, id)
    {world.step, world.at_ms, world.landmark, world.objects, poses, {pan, tilt, angle}}
  end

  @doc "The world as the camera of robot `id` sees it."
  @spec world(ground(), moving(), World.id()) :: World.t()
  def world(%World{} = ground, {step, at_ms, landmark, objects, poses, ptz}, id) do
    {pan, tilt, angle} = ptz

    robots =
      for {other, {x, y, heading}} <- Enum.zip(ground.order, poses), into: %{} do
        {other, %{ground.robots[other] | pose: %Pose{x: x, y: y, heading: heading}}}
      end

    robots = Map.update!(robots, id, &%{&1 | pan: pan, tilt: tilt, field_of_view: angle})
    %{ground | step: step, at_ms: at_ms, landmark: landmark, objects: objects, robots: robots}
  end

  # A camera sees only the outline of the others.
  defp slim(body, true),
    do: %{body | sonar: [], geometry: <<>>, ir: [], infrared: <<>>, lidar: <<>>, scan: nil}

  defp slim(%{profile: %{radius: radius, height: height}} = body, false),
    do: %{
      body
      | profile: %{radius: radius, height: height},
        sonar: [],
        geometry: <<>>,
        ir: [],
        infrared: <<>>,
        lidar: <<>>,
        scan: nil
    }
end
