defmodule Sim.World.Touch do
  @moduledoc "Detects contacts after a step, and their consequences. Pure."
  alias Sim.World.{Body, Contact}
  alias Sim.World.Bodies

  # So many contacts are told of.
  @kept 8

  @doc """
  Updates the world's contacts, the count of new ones, the least gap, and the pressed bumpers.
  """
  @spec touch(Sim.World.t()) :: Sim.World.t()
  def touch(world) do
    bodies = Bodies.all(world)
    count = length(bodies)

    discs =
      Enum.map(bodies, &{&1.index, Bodies.disc(&1)}) ++ Enum.map(Bodies.pole(world), &{count, &1})

    {touching, together, least} = Contact.pairs(discs, count, world.min_separation)

    walls = for {index, disc} <- discs, index < count, do: {index, Contact.walls(world.map, disc)}
    at_wall = for {index, {[_ | _], _}} <- walls, do: {index, :wall}
    near_wall = for {index, {_, true}} <- walls, do: {index, :wall}

    # The landmark is the last disc: touching it presses bumpers but is not a collision.
    now = MapSet.new(at_wall ++ for({_, j} = pair <- touching, j < count, do: pair))
    near = MapSet.new(near_wall ++ together)
    new = now |> MapSet.difference(world.together) |> Enum.sort()
    places = Map.new(discs)

    bodies =
      for {body, {_, {points, _}}} <- Enum.zip(bodies, walls),
          do: Body.press(body, points ++ touched(body.index, touching, places), world.at_ms)

    %{
      Bodies.put(world, bodies)
      | collisions: world.collisions + length(new),
        contacts: Enum.take(Enum.map(new, &contact(world, &1)) ++ world.contacts, @kept),
        together: world.together |> MapSet.union(now) |> MapSet.intersection(near),
        min_separation: least
    }
  end

  defp contact(world, {i, :wall}), do: {world.at_ms, [party(world, i)], :wall}
  defp contact(world, {i, j}), do: {world.at_ms, [party(world, i), party(world, j)], :robots}

  defp party(world, index) do
    %{id: id, pose: pose, wanted: wanted} = world.robots[Enum.at(world.order, index)]
    {id, {pose.x, pose.y}, wanted.linear}
  end

  # The directions of the others that a body touches: discs touch on the line between their
  # centres.
  defp touched(index, touching, places) do
    for {i, j} <- touching, index in [i, j] do
      {x, y, _radius} = places[if(i == index, do: j, else: i)]
      {x, y}
    end
  end
end
