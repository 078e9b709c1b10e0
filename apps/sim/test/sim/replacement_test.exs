defmodule Sim.ReplacementTest do
  @moduledoc "A live fleet is given other missions, and new code of one of the box, while it drives."
  use ExUnit.Case, async: false
  import Swarm.Case, only: [eventually: 1, order: 1]
  alias Hal.Event
  alias Robot.Board
  alias Sim.Fleet
  alias Swarm.Versions
  @moduletag :realtime
  @moduletag :capture_log

  @ids [:mag61, :mag62, :min61]

  # Code of the patrol's name that is none of it; the release's is loaded again when it is called.
  defp version(number, kind) do
    before = Code.get_compiler_option(:ignore_module_conflict)
    Code.put_compiler_option(:ignore_module_conflict, true)
    :code.delete(Missions.Patrol)
    :code.purge(Missions.Patrol)
    code = Versions.code(Missions.Patrol, number, kind)
    Code.put_compiler_option(:ignore_module_conflict, before)
    code
  end

  @doc false
  def stage(_event, _measured, %{stage: :replacement, robot: id, what: what} = about, test),
    do: send(test, {what, id, speed(id), about.says})

  def stage(_event, _measured, _about, _test), do: :ok

  # What its wheels reported last, m/s.
  defp speed(id) do
    {:ok, %{twist: twist}, _at_ms} = Board.fetch(Board.find!(id), :odometry, :infinity)
    abs(twist.linear)
  end

  defp told(what, ids \\ @ids) do
    for id <- ids do
      assert_receive {^what, ^id, speed, says}, 30_000
      {speed, says}
    end
  end

  defp states, do: for(id <- @ids, do: Swarm.status(id))
  defp drive?, do: Enum.any?(@ids, &(speed(&1) > 0.1))

  setup do
    handler = {__MODULE__, self()}
    :ok = Event.attach(handler, [:robot, :stage], &__MODULE__.stage/4, self())

    options = [
      robots: @ids,
      landmark: :none,
      map: "hall",
      seed: 3,
      mission: {:patrol, period: 60}
    ]

    {:ok, fleet} = Fleet.start_link(options)

    on_exit(fn ->
      Event.detach(handler)
      monitor = Process.monitor(fleet)
      assert_receive {:DOWN, ^monitor, _, _, _}, 5_000
    end)

    eventually(&drive?/0)
    %{fleet: fleet}
  end

  test "all stand, change, and go on with another mission of the release", %{fleet: fleet} do
    assert order(fn -> Swarm.replace(:all, {:flock, spacing: 1.2}) end) == :ok
    assert Enum.any?(told(:changing), fn {speed, _says} -> speed > 0.05 end)
    for {speed, _says} <- told(:replaced), do: assert(speed <= 0.02)

    for id <- @ids,
        do: eventually(fn -> Swarm.status(id).state in [:gather, :flock, :arrived] end)

    eventually(&drive?/0)

    assert Enum.map(told(:kept), &elem(&1, 1)) |> Enum.uniq() == [
             "keeps flock, given by #{node()}"
           ]

    # People see it among the stages of the run.
    assert %{stages: stages} = Fleet.scene(fleet)
    assert Enum.any?(stages, &(&1.stage == :replacement))
    assert Fleet.result(fleet).collisions == 0
    Fleet.stop(fleet)
  end

  test "who orders another mission as soon as the fleet is there is not overtaken by its first start",
       %{fleet: fleet} do
    Fleet.stop(fleet)
    {:ok, fleet} = Fleet.start_link(robots: @ids, landmark: :none, mission: :patrol)
    assert order(fn -> Swarm.replace(:all, :flock) end) == :ok
    told(:replaced)

    for id <- @ids,
        do: eventually(fn -> Swarm.status(id).state in [:gather, :flock, :arrived] end)

    told(:kept)
    for id <- @ids, do: assert(Swarm.status(id).state in [:gather, :flock, :arrived])
    Fleet.stop(fleet)
  end

  @tag long: true, realtime: :long
  test "new code of the patrol comes while it drives; a wrong version goes back on all; the fleet's end returns to the release",
       %{fleet: fleet} do
    Fleet.stop(fleet)
    # Compiled while no robot runs it.
    [second, wrong] = for {n, kind} <- [{2, :good}, {3, :crash}], do: version(n, kind)
    md5 = Missions.Patrol.module_info(:md5)

    options = [
      robots: @ids,
      landmark: :none,
      map: "hall",
      seed: 3,
      mission: {:patrol, period: 60}
    ]

    # Off unless configured, of simulated robots, too.
    {:ok, fleet} = Fleet.start_link(options)
    assert {:error, line} = order(fn -> Swarm.replace(:all, {:code, second}) end)
    assert line =~ "it takes no code from others"
    Fleet.stop(fleet)
    {:ok, fleet} = Fleet.start_link([replace: :code] ++ options)
    eventually(&drive?/0)

    assert order(fn -> Swarm.replace(:all, {:code, second, speed: 0.2}) end) == :ok
    for {speed, _says} <- told(:replaced), do: assert(speed <= 0.02)
    eventually(fn -> Enum.any?(states(), &match?(%{says: "version 2"}, &1)) end)
    eventually(&drive?/0)
    told(:kept)

    assert order(fn -> Swarm.replace(:all, {:code, wrong, speed: 0.3}) end) == :ok
    told(:replaced)

    for {speed, says} <- told(:back),
        do: assert({speed <= 0.5, says =~ "version 3 is wrong"} == {true, true})

    eventually(fn -> Enum.any?(states(), &match?(%{says: "version 2"}, &1)) end)
    eventually(&drive?/0)
    assert Fleet.result(fleet).collisions == 0

    assert Missions.Patrol.module_info(:md5) != md5
    Fleet.stop(fleet)
    eventually(fn -> Missions.Patrol.module_info(:md5) == md5 end)
  end
end
