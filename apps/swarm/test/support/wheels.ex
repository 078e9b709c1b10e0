defmodule Swarm.MeshNodes.Wheels do
  @moduledoc """
  A robot on a test's node: the whole tree with a fake drive, whose wheels report ten times a
  second that they stand.
  """
  use GenServer
  alias Hal.Pose

  @period_ms 100

  @doc "Starts a robot on this node, under its fleet; options of its comms process, and of its config."
  @spec robot(atom(), keyword(), keyword()) :: :ok
  def robot(id, comms \\ [], options \\ []) do
    {:ok, _wheels} = GenServer.start(__MODULE__, {id, comms, options})
    :ok
  end

  @impl GenServer
  def init({id, comms, options}) do
    drive = {Hal.FakeDrive, test: self(), device: :drive}
    own = [id: id, profile: Hal.Profile.magellan(), drive: drive]
    config = Robot.Config.new!(own ++ options)

    {:ok, _robot} = Robot.Fleet.start_robot(Robot.Fleet, Swarm.Comms.join(config, comms))
    {:ok, _timer} = :timer.send_interval(@period_ms, :stand)
    {:ok, %{id: id, n: 0}}
  end

  @impl GenServer
  def handle_info(:stand, s) do
    if Robot.Names.whereis(s.id, :drive),
      do: Swarm.Case.stand(s.id, Pose.new(0.001 * rem(s.n, 2), 0))

    {:noreply, %{s | n: s.n + 1}}
  end

  def handle_info(_asked_of_the_drive, s), do: {:noreply, s}
end
