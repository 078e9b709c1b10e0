defmodule Sim.World.Motion do
  @moduledoc "Moves everything that moves by one step: robots, what they push, and the landmark. Pure."
  alias Hal.Pose
  alias Sim.World.{Bodies, Body, Contact, Object, Pushing}

  @glide 0.3
  @polite 0.5

  @doc """
  Moves the landmark for `dt_ms`, at 0.3 m/s; it waits 0.5 m in front of a robot, and stops in
  front of a wall.
  """
  @spec glide(Sim.World.t(), pos_integer()) :: Sim.World.t()
  def glide(%{goal: nil} = world, _dt_ms), do: world

  def glide(%{landmark: {x, y} = here, goal: {gx, gy} = goal} = world, dt_ms) do
    way = @glide * dt_ms / 1000
    left = Pose.distance(here, goal)
    next = if left <= way, do: goal, else: {x + (gx - x) * way / left, y + (gy - y) * way / left}
    objects = Enum.flat_map(world.objects, &Object.discs/1)
    discs = Enum.map(Bodies.all(world), &Bodies.disc/1) ++ objects

    blocked? =
      Enum.any?(discs, fn robot ->
        gap = Contact.gap(landmark(next), robot)
        gap < @polite and gap < Contact.gap(landmark(here), robot)
      end) or not Sim.Floorplan.free?(world.map, next, Bodies.landmark_radius())

    cond do
      blocked? -> world
      next == goal -> %{world | landmark: goal, goal: nil}
      true -> %{world | landmark: next}
    end
  end

  defp landmark({x, y}), do: {x, y, Bodies.landmark_radius()}

  @doc """
  Moves all robots for `dt_ms`, one after the other: each goes as far as the others let it, of
  which those before it have already moved and those after it have not. What it pushes makes way, or stops it.
  """
  @spec move(Sim.World.t(), pos_integer()) :: Sim.World.t()
  def move(world, dt_ms) do
    bodies = Bodies.all(world)
    discs = Map.new(bodies, &{&1.index, Bodies.disc(&1)})
    neighbours = neighbours(bodies, discs, dt_ms)

    {bodies, {_discs, objects}} =
      Enum.map_reduce(bodies, {discs, world.objects}, fn body, {discs, objects} ->
        body = body |> Body.accelerate(dt_ms) |> Body.slew(dt_ms)
        {body, way, along, turn} = Body.intend(body, dt_ms, world.seed, world.noise)
        others = Bodies.pole(world) ++ for j <- Map.get(neighbours, body.index, []), do: discs[j]
        {place, share} = Contact.move(world.map, discs[body.index], way, others)
        {place, share, objects} = push(objects, {place, share}, body, discs, world, dt_ms)

        body =
          Body.arrive(
            body,
            place,
            share,
            {along, turn},
            dt_ms,
            {world.seed, world.step},
            world.noise
          )

        {body, {Map.put(discs, body.index, Bodies.disc(body)), objects}}
      end)

    Pushing.roll(Bodies.put(%{world | objects: objects}, bodies), dt_ms)
  end

  defp push([], {place, share}, _body, _discs, _world, _dt_ms), do: {place, share, []}

  defp push(objects, {{x, y} = place, share}, body, discs, world, dt_ms) do
    {was_x, was_y, r} = discs[body.index]
    others = Bodies.pole(world) ++ Map.values(Map.delete(discs, body.index))

    case Pushing.give(objects, {x, y, r}, {was_x, was_y}, {world.map, others}, dt_ms) do
      {:ok, objects} -> {place, share, objects}
      :stuck -> {{was_x, was_y}, 0.0, objects}
    end
  end

  # The robots that each can meet in this step if both drive as fast as they can.
  defp neighbours(bodies, discs, dt_ms) do
    fastest = bodies |> Enum.map(& &1.profile.max_linear) |> Enum.max(fn -> 0.0 end)

    for {i, j, _gap} <-
          Contact.close(Map.to_list(discs), 0.01 + 2 * fastest * dt_ms / 1000),
        {a, b} <- [{i, j}, {j, i}],
        reduce: %{} do
      near -> Map.update(near, a, [b], &[b | &1])
    end
  end
end
