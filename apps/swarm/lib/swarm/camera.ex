defmodule Swarm.Camera do
  @moduledoc """
  Describes what a robot's camera sees, for people, as JPEG.

      {:ok, jpeg} = Swarm.Camera.snapshot(:mag1)
      File.write!("mag1.jpg", jpeg)

  and as a stream of pictures to this process, which asks for each one after the first, so that it
  never gets more than it can handle:

      {:ok, ref} = Swarm.Camera.subscribe(:mag1, rate: 5)
      receive do {:picture, ^ref, %Vision.View.Picture{jpeg: jpeg}} -> File.write!("mag1.jpg", jpeg) end
      Swarm.Camera.next(:mag1, ref)
      Swarm.Camera.unsubscribe(:mag1, ref)

  Pictures are made only while there is a subscriber, and do not leave the robot's node: they would delay
  the robots' messages to each other. On another node each of these functions returns an error;
  use a shell on the robot's own node (`bin/robot remote`). Nothing raises, whatever the
  arguments.
  """
  alias Robot.Names
  alias Swarm.{Commands, Directory}
  alias Vision.View

  @doc "The current picture as JPEG, or an error that says why there is none. Waits at most 5 s."
  @spec snapshot(Swarm.robot()) :: {:ok, jpeg :: binary()} | {:error, line :: String.t()}
  def snapshot(robot) do
    with {:ok, view} <- view(robot),
         {:ok, picture} <- View.snapshot(view),
         do: {:ok, picture.jpeg}
  end

  @doc """
  Subscribes the calling process to at most `rate:` pictures a second (0.001 to 30, default 5).
  `ref` is also a monitor: `{:DOWN, ref, …}` says that the view has ended.
  """
  @spec subscribe(Swarm.robot(), keyword()) :: {:ok, reference()} | {:error, line :: String.t()}
  def subscribe(robot, options \\ []) do
    with {:ok, view} <- view(robot), do: View.subscribe(view, options)
  end

  @doc "Asks for the next picture."
  @spec next(Swarm.robot(), reference()) :: :ok | {:error, line :: String.t()}
  def next(robot, ref), do: tell(robot, ref, &View.next/2)

  @doc "Ends the subscription."
  @spec unsubscribe(Swarm.robot(), reference()) :: :ok | {:error, line :: String.t()}
  def unsubscribe(robot, ref), do: tell(robot, ref, &View.unsubscribe/2)

  @doc """
  The number of viewers, the number of pictures made, how often making one failed, and why it last
  did. For a robot that saves pictures, `saver` says how many there are, and why none are saved at
  present.
  """
  @spec status(Swarm.robot()) :: map() | {:error, line :: String.t()}
  def status(robot) do
    with {:ok, view} <- view(robot), {:ok, [id]} <- one(robot) do
      case Names.whereis(id, :saver) do
        nil -> View.status(view)
        saver -> Map.put(View.status(view), :saver, Vision.Saver.status(saver))
      end
    end
  end

  defp tell(robot, ref, order) when is_reference(ref) do
    with {:ok, view} <- view(robot) do
      if View.looks?(view, ref),
        do: order.(view, ref),
        else: {:error, "this process has no subscription #{inspect(ref)}; subscribe first"}
    end
  end

  defp tell(_robot, other, _order),
    do: {:error, "#{inspect(other, limit: 5)} is not a reference from subscribe"}

  defp view(robot) do
    with {:ok, [id]} <- one(robot) do
      case {Names.whereis(id, :view), Names.whereis(id, :robot)} do
        {view, _robot} when view != nil -> {:ok, view}
        {nil, nil} -> {:error, elsewhere(id, Directory.whereis(id))}
        {nil, _robot} -> {:error, "#{id} has no camera"}
      end
    end
  end

  defp one(robots) when is_list(robots) or robots == :all,
    do: {:error, "one robot is needed, not #{inspect(robots, limit: 5)}"}

  defp one(robot), do: Commands.robots(robot)

  defp elsewhere(id, comms) do
    where = if is_pid(comms), do: "on #{node(comms)}", else: "on another node"
    "#{id} is #{where}, and pictures do not leave their node: look from there"
  end
end
