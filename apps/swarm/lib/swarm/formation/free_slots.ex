defmodule Swarm.Formation.FreeSlots do
  @moduledoc """
  Finds the free slots of a shape: a dead robot's body leaves no room for another robot. The shape
  grows by as many slots as are lost. Pure; metres.
  """
  alias Hal.Pose
  alias Swarm.Formation

  # The gap from edge to edge between a standing robot and a dead one.
  @gap 0.2
  # If a shape loses more slots than this, it is used as it is.
  @most 20

  @typedoc "The size of the whole shape, the leader included, and the numbers of the used slots."
  @type t :: {size :: pos_integer(), places :: [pos_integer()]}

  @doc """
  The slots for so many followers around a leader at `pose`, without those that `bodies`
  (`{x, y, radius}`) occupy. `radius` is that of the largest follower.

      iex> Swarm.Formation.FreeSlots.places({:column, 1.0}, 3, Hal.Pose.new(0, 0), 1.6, [], 0.2)
      {4, [1, 2, 3]}
      iex> Swarm.Formation.FreeSlots.places({:column, 1.0}, 3, Hal.Pose.new(0, 0), 1.6, [{-2.1, 0.0, 0.2}], 0.2)
      {5, [1, 3, 4]}
  """
  @spec places(Formation.t(), non_neg_integer(), Pose.t(), float(), [tuple()], float()) :: t()
  def places(formation, followers, pose, distance, bodies, radius),
    do: places(formation, followers, pose, distance, &free?(&1, bodies, radius))

  @doc "The same, where a function says of a pose whether a robot can stand there."
  @spec places(Formation.t(), non_neg_integer(), Pose.t(), float(), (Pose.t() -> boolean())) ::
          t()
  def places(formation, followers, pose, distance, free?) do
    Enum.find_value(followers..(followers + @most), whole(followers), fn slots ->
      free =
        formation
        |> Formation.slots(slots + 1, distance)
        |> Enum.with_index(1)
        |> Enum.filter(fn {slot, _k} -> free?.(Pose.compose(pose, slot)) end)

      if length(free) >= followers,
        do: {slots + 1, free |> Enum.take(followers) |> Enum.map(&elem(&1, 1))}
    end)
  end

  @doc "All slots of a shape without gaps."
  @spec whole(non_neg_integer()) :: t()
  def whole(followers), do: {followers + 1, Enum.to_list(1..followers//1)}

  @doc "Whether a robot of this radius can stand there."
  @spec free?(Pose.t(), [{float(), float(), float()}], float()) :: boolean()
  def free?(place, bodies, radius) do
    Enum.all?(bodies, fn {x, y, other} ->
      Pose.distance(place, {x, y}) >= radius + other + @gap
    end)
  end
end
