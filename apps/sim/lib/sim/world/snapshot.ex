defmodule Sim.World.Snapshot do
  @moduledoc """
  Packs the changes of a world since its start, small enough to send ten times a second; together with the initial world
  they restore the whole world. Pure.

  A world that is started from a snapshot goes on where it was; only the sonars are fired again, and the lidars turned, by
  its first step.
  """
  alias Hal.Pose
  alias Sim.World
  alias Sim.World.Body

  @moving ~w(step at_ms landmark objects goal collisions contacts min_separation together)a
  @body ~w(pose odometry alive wanted ramp speed measured turn look pan tilt field_of_view pressed)a

  @type t :: {[term()], [[term()]]}

  @doc "The changed parts of a world."
  @spec of(World.t()) :: t()
  def of(%World{} = world) do
    {values(world, @moving), for(id <- world.order, do: values(world.robots[id], @body))}
  end

  @doc "The world that started as `begun`, in its state at the snapshot."
  @spec onto(World.t(), t()) :: World.t()
  def onto(%World{} = begun, {world, bodies}) do
    robots =
      for {id, body} <- Enum.zip(begun.order, bodies), into: %{} do
        %Body{} = at_start = begun.robots[id]
        {id, changed(at_start, @body, body)}
      end

    changed(%{begun | robots: robots}, @moving, world)
  end

  @doc """
  Where the wheels of a robot would have begun to count, by where its body was then: what a person tells a robot
  that is switched on again. With `:zero` its wheels count from nothing, as those of a real base do.
  """
  @spec start(t(), World.t(), atom(), :zero | :on) :: Pose.t()
  def start(snapshot, begun, robot, wheels) do
    %{pose: pose, odometry: odometry} = onto(begun, snapshot).robots[robot]
    zero = Pose.new(0.0, 0.0)
    if wheels == :zero, do: pose, else: Pose.compose(pose, Pose.relative(odometry, zero))
  end

  defp values(struct, keys), do: Enum.map(keys, &Map.fetch!(struct, &1))
  defp changed(struct, keys, values), do: struct!(struct, Enum.zip(keys, values))
end
