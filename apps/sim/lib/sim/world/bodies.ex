defmodule Sim.World.Bodies do
  @moduledoc "Lists the solid objects of a world as discs. Pure."
  alias Sim.World.{Body, Contact, Object}

  @landmark_radius 0.15

  @doc "The landmark's radius in metres."
  @spec landmark_radius() :: float()
  def landmark_radius, do: @landmark_radius

  @doc "All robots' bodies, in the order of the fleet."
  @spec all(Sim.World.t()) :: [Body.t()]
  def all(world), do: Enum.map(world.order, &Map.fetch!(world.robots, &1))

  @doc "The world with these bodies in place of its robots."
  @spec put(Sim.World.t(), [Body.t()]) :: Sim.World.t()
  def put(world, bodies), do: %{world | robots: Map.new(bodies, &{&1.id, &1})}

  @doc "A robot as a disc."
  @spec disc(Body.t()) :: Contact.disc()
  def disc(%Body{pose: pose, profile: profile}), do: {pose.x, pose.y, profile.radius}

  @doc "The landmark as a disc, if there is one."
  @spec pole(Sim.World.t()) :: [Contact.disc()]
  def pole(%{landmark: nil}), do: []
  def pole(%{landmark: {x, y}}), do: [{x, y, @landmark_radius}]

  @doc "Whether an object has room where it is, among walls, robots, the landmark and other objects."
  @spec room?(Sim.World.t(), Object.t(), [Object.t()]) :: boolean()
  def room?(world, object, others) do
    discs = Enum.map(all(world), &disc/1) ++ pole(world) ++ Enum.flat_map(others, &Object.discs/1)

    Object.free?(object, world.map) and
      Enum.all?(discs, &(elem(Object.gap(object, &1), 0) >= 0.0))
  end

  @doc "Whether a robot's body would touch another one, or the landmark, at this place. A wall is refused before the run."
  @spec occupied?(Sim.World.t(), atom(), Hal.Pose.point()) :: boolean()
  def occupied?(world, id, {x, y}) do
    radius = world.robots[id].profile.radius
    others = for(body <- all(world), body.id != id, do: disc(body)) ++ pole(world)

    Enum.any?(others, fn {ox, oy, other} ->
      Hal.Pose.distance({x, y}, {ox, oy}) < radius + other
    end)
  end
end
