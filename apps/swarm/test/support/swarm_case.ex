defmodule Swarm.Case do
  @moduledoc """
  Robots with fake drives and comms processes. Names and directory are shared by all tests of a
  VM, so robots get names of their own; the test sends the drive's readings.
  """
  use ExUnit.CaseTemplate
  alias Hal.{Odometry, Pose, Twist}
  alias Robot.Names

  using do
    quote do
      import Swarm.Case
      import Robot.Case, only: [listen: 2, kill: 2]
      alias Hal.{Pose, Twist}
      alias Robot.{Board, Names}
      alias Robot.Control.Pilot
      alias Robot.Safety.Gate
      alias Swarm.{Comms, Directory, Message}
      alias Swarm.Membership.Heartbeat
    end
  end

  setup do
    unless Process.whereis(Robot.Names), do: start_supervised!(Swarm.Supervisor)

    # A stop that the test before did not reset is repeated for a second, to those that are switched on then, too.
    Swarm.EStop.Broadcaster.quiet(:all)
    :sys.get_state(Swarm.EStop.Broadcaster)
    :ok
  end

  @doc """
  Starts a robot with a comms process; its options are under `:comms`, the others as in
  `Robot.Config`.
  """
  def robot(id, options \\ []) do
    {comms, options} = Keyword.pop(options, :comms, [])
    config = id |> Robot.Case.config(options) |> Swarm.Comms.join(comms)
    start_supervised!({Robot.Supervisor, config}, id: id, restart: :temporary)
    stand(id, Pose.new(0, 0))
    if options[:drive] == nil, do: Robot.Case.online(id)
    eventually(fn -> Swarm.Directory.whereis(id) end)
    id
  end

  @doc "The same on another node (`Swarm.Cluster`), which the robot ends with; no drive tells the test."
  def robot_on(node, id, options \\ []) do
    {comms, options} = Keyword.pop(options, :comms, [])
    options = Keyword.put_new(options, :drive, {Hal.FakeDrive, test: self(), device: id})
    config = id |> Robot.Case.config(options) |> Swarm.Comms.join(comms)
    {:ok, _robot} = :erpc.call(node, Robot.Fleet, :start_robot, [Robot.Fleet, config])
    :erpc.call(node, __MODULE__, :stand, [id, Pose.new(0, 0)])
    eventually(fn -> node(Swarm.Directory.whereis(id) || self()) == node end)
    id
  end

  @doc "The value of a robot's board entry, on any node; `nil` if there is none."
  def entry(node, id, key) do
    {:ok, board} = :erpc.call(node, Robot.Board, :find, [id])

    case :erpc.call(node, Robot.Board, :fetch, [board, key, :infinity]) do
      {:ok, value, _at_ms} -> value
      :error -> nil
    end
  end

  @doc "Lets the wheels report that the robot stands there."
  def stand(id, pose) do
    free = List.duplicate(5.0, 16)
    odometry = {:odometry, %Odometry{pose: pose, twist: Twist.zero()}}
    send(Names.whereis(id, :drive), {:readings, [odometry, {:sonar, free}]})
    id
  end

  @doc "Lets the wheels report that all the time, ten times a second, as real ones do."
  def standing(ids) do
    start_supervised!(
      {Task,
       fn ->
         Stream.interval(100)
         |> Enum.each(fn n ->
           for id <- ids, Names.whereis(id, :drive), do: stand(id, Pose.new(0.001 * rem(n, 2), 0))
         end)
       end},
      id: {:wheels, ids}
    )

    ids
  end

  @doc """
  The answer to an order. On a busy machine a live robot may be silent for 0.4 s, or an order may
  reach it too late, and the order is refused for that; a person then gives it again. Any other
  refusal is the answer.
  """
  def order(give) do
    {:answer, answer} =
      eventually(fn ->
        answer = give.()
        unless busy?(answer), do: {:answer, answer}
      end)

    answer
  end

  defp busy?({:error, line}),
    do: Enum.any?([" hangs in ", " does not answer", "; repeat "], &String.contains?(line, &1))

  defp busy?(_answer), do: false

  @doc """
  Waits until a function returns something, and returns it. It looks less often the longer it waits: what it asks
  costs the robots that it waits for processor time.
  """
  def eventually(function, ms \\ 30_000) do
    now = System.monotonic_time(:millisecond)
    wait(function, now, now + ms)
  end

  defp wait(function, began, deadline) do
    value = function.()
    now = System.monotonic_time(:millisecond)

    cond do
      value -> value
      now > deadline -> ExUnit.Assertions.flunk("waited in vain")
      true -> pause(min(5 + div(now - began, 10), 50), function, began, deadline)
    end
  end

  defp pause(ms, function, began, deadline) do
    receive do
      :never -> :ok
    after
      ms -> wait(function, began, deadline)
    end
  end
end
