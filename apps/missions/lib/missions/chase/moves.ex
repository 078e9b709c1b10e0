defmodule Missions.Chase.Moves do
  @moduledoc false
  # Turns what a robot of a chase does into the goal that moves it. Pure.
  alias Hal.Pose
  alias Missions.Chase.{Driver, Push, Ring, Search}
  alias Robot.Behaviour.{Goto, Stop, Velocity}
  alias Robot.Percept.CameraPointing

  # From so far (metres) it looks at a ball whose place is uncertain; on its way it keeps so far from it.
  @looks_from 1.6
  @clear 0.45
  # A place that moved so far (metres) is another one; a robot in the ring follows its place when that is so far away.
  @same 0.1
  @follows 0.5
  @tolerance 0.15
  @doc "The goal of this tick, and the mission that gives it; `scene` is what it knows of the ball."
  @spec goal(Missions.Chase.t(), map() | nil, Robot.Percept.t()) ::
          {Robot.Mission.order(), Missions.Chase.t()}
  def goal(%{phase: :search} = mission, _scene, percept) do
    last = mission.track && mission.track.at
    {goal, search} = Search.goal(mission.search, mission.me, last, percept, mission.colour)
    {goal, %{mission | search: search, target: nil}}
  end

  def goal(%{phase: :scored} = mission, _scene, _percept), do: stand(mission)

  def goal(%{phase: :push} = mission, scene, percept) do
    speed = if scene.far < 2 * mission.within, do: 0.7 * mission.speed, else: mission.speed
    velocity = Push.velocity(scene, percept.pose, mission.side, speed)
    {{:goal, :push, {Velocity, velocity: velocity}}, %{mission | target: nil}}
  end

  def goal(%{phase: :approach, looks?: true} = mission, scene, percept) do
    angle = Push.direction(scene.ball, Pose.point(percept.pose))
    {x, y} = scene.ball
    place = {x + @looks_from * :math.cos(angle), y + @looks_from * :math.sin(angle)}
    go(mission, place, scene, @clear)
  end

  def goal(%{phase: :approach} = mission, scene, _percept) do
    case Push.behind(scene) do
      {place, _side} -> go(mission, place, scene, 0.05)
      nil -> stand(mission)
    end
  end

  def goal(%{phase: :ring} = mission, scene, percept) do
    drives = Driver.other(mission.heard, mission.now_ms)

    present =
      for {id, at, mode} <- scene.others,
          mode != :dead,
          id != drives,
          is_map_key(mission.heard, id),
          do: {id, at}

    robots = Map.new([{mission.me, Pose.point(percept.pose)} | present])

    case Ring.place(
           mission.me,
           robots,
           scene.ball,
           scene.goal,
           mission.ring,
           scene.grid,
           scene.radius
         ) do
      nil ->
        stand(mission)

      place ->
        if stays?(mission, place, scene, percept),
          do: stand(mission),
          else: go(mission, place, scene, @clear)
    end
  end

  # It sees the ball from where it is, and its place is near.
  defp stays?(%{rests?: rests?}, place, scene, %{pose: pose} = percept) do
    rests? and Pose.distance(pose, place) < @follows and
      CameraPointing.within?(Pose.bearing(pose, scene.ball), percept)
  end

  defp stand(mission), do: {{:goal, :stand, {Stop, []}}, mission}

  defp go(%{target: target} = mission, place, scene, clear) do
    new? = target == nil or Pose.distance(target, place) > @same
    # One that has arrived is on its way again.
    go = if mission.rests?, do: mission.go + 1, else: mission.go
    {x, y} = place = if new?, do: place, else: target
    {bx, by} = scene.ball
    facing = Push.direction(place, scene.ball)

    options = [
      x: x,
      y: y,
      heading: facing,
      heading_tolerance: 0.25,
      tolerance: @tolerance,
      discs: [{bx, by, scene.ball_radius + clear}]
    ]

    {{:goal, {:go, go}, {Goto, options}}, %{mission | target: place, go: go, rests?: false}}
  end

  @doc "Where the camera looks: at the ball."
  @spec pan(map() | nil, Robot.Percept.t()) :: float()
  def pan(nil, _percept), do: 0.0

  def pan(%{ball: ball}, percept),
    do: CameraPointing.pan(Pose.bearing(percept.pose, ball), percept)
end
