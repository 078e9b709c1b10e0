defmodule Missions.Push.Moves do
  @moduledoc """
  Says where a robot of `Missions.Push` drives in each of its phases: it looks for the box, watches it from before, where those that push do not hide
  it, goes round it to its place, and pushes. Pure.
  """
  alias Hal.Pose
  alias Missions.Chase.{Ring, Search}
  alias Missions.Push
  alias Missions.Push.{Box, Estimate, Places, Plan}
  alias Robot.Behaviour.{Goto, Stop, Velocity}
  alias Robot.Percept.CameraPointing

  # From where the others watch, unless they see nothing for so long, as too near to a box that lies elsewhere.
  @ring 2.6
  @arc {0.35, 1.4}
  @blind_ms 4_000
  @back 0.7
  # What they and those on their way to a place keep from the box, edge to edge.
  @clear 0.45
  @near 0.12
  @same 0.1
  @follows 0.4
  @tolerance 0.1
  @heading_tolerance 0.15
  @aside_ms 8_000

  @doc "How far from the middle of the box robots watch it, in metres: nearer, they do not see its foot."
  @spec ring() :: float()
  def ring, do: @ring

  @doc "The goal of this tick, and the mission with what it is to remember of it."
  @spec goal(Push.t(), map() | nil, Robot.Percept.t()) :: {Robot.Mission.effect(), Push.t()}
  def goal(%{phase: :search} = mission, _scene, percept) do
    last = mission.box && Pose.point(elem(Estimate.best(mission.box), 0))
    {goal, search} = Search.goal(mission.search, mission.me, last, percept, mission.colour)
    {goal, %{mission | search: search, target: nil}}
  end

  def goal(%{phase: :done} = mission, _scene, _percept), do: stand(mission)

  def goal(%{phase: :push, side: side} = mission, scene, percept) do
    partner = Places.partner_gap(mission, scene, percept)
    velocity = Plan.velocity(scene, side, percept.pose, partner)
    {{:goal, :push, {Velocity, velocity: velocity}}, %{mission | target: nil, rests?: false}}
  end

  def goal(%{phase: :approach, stage: :ready} = mission, _scene, _percept), do: stand(mission)

  def goal(%{phase: :approach, side: side} = mission, scene, _percept) do
    go(mission, Plan.place(scene, side), scene.direction, scene, @near)
  end

  def goal(%{phase: :watch} = mission, scene, percept) do
    pushers = for {id, %{side: side}} <- Places.fresh(mission), side != nil, do: id

    present =
      for {id, at, mode} <- scene.others,
          mode != :dead,
          id not in pushers,
          is_map_key(mission.heard, id),
          do: {id, at}

    robots = Map.new([{mission.me, Pose.point(percept.pose)} | present])
    middle = Pose.point(scene.box)

    # Too near to the box, which may lie elsewhere, none sees its foot.
    unseen? = mission.now_ms - mission.box.seen_ms > @blind_ms
    ring = if unseen?, do: @ring + @back, else: @ring

    case Ring.place(
           mission.me,
           robots,
           middle,
           mission.goal,
           ring,
           scene.grid,
           scene.radius,
           @arc
         ) do
      nil ->
        stand(mission)

      {x, y} = place ->
        if not unseen? and stays?(mission, place, scene, percept),
          do: stand(mission),
          else: go(mission, place, :math.atan2(scene.box.y - y, scene.box.x - x), scene, @clear)
    end
  end

  # It sees the box from where it is, and its place is near.
  defp stays?(%{rests?: rests?}, place, scene, %{pose: pose} = percept) do
    rests? and Pose.distance(pose, place) < @follows and
      CameraPointing.within?(Pose.bearing(pose, scene.box), percept)
  end

  defp stand(mission), do: {{:goal, :stand, {Stop, []}}, mission}

  defp go(%{target: target} = mission, place, heading, scene, clear) do
    new? = target == nil or Pose.distance(target, place) > @same
    # One that has arrived is on its way again.
    go = if mission.rests?, do: mission.go + 1, else: mission.go
    {x, y} = place = if new?, do: place, else: target

    options = [
      x: x,
      y: y,
      heading: heading,
      heading_tolerance: @heading_tolerance,
      tolerance: @tolerance,
      discs: Box.discs(scene.box, scene.size, clear)
    ]

    {{:goal, {:go, go}, {Goto, options}}, %{mission | target: place, go: go, rests?: false}}
  end

  @doc "The mission after a way ended with this outcome."
  @spec arrived(Push.t(), integer()) :: Push.t()
  def arrived(%{phase: :approach} = mission, outcome) when outcome != 1,
    do: %{
      Places.rest(mission, :watch)
      | rests?: true,
        target: nil,
        aside_ms: (mission.now_ms || 0) + @aside_ms
    }

  def arrived(mission, _outcome), do: %{mission | rests?: true}
end
