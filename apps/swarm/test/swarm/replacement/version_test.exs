defmodule Swarm.Replacement.VersionTest do
  @moduledoc "Code that a robot's release does not have, on robots of this node with fake wheels."
  use Swarm.Case, async: false
  alias Swarm.{Replacement, StandMission, Versions}
  @moduletag :capture_log
  @moduletag :realtime

  setup do
    # Nobody watches what the test before has left.
    :ok = :sys.terminate(Process.whereis(Replacement.Server), :normal)
    eventually(fn -> Process.whereis(Replacement.Server) end)
    :ok
  end

  defp replaceable(id, options \\ []) do
    robot(id, [replace: :code] ++ options)
    standing([id])
    assert order(fn -> Swarm.start(StandMission, robots: [id], formation: :wedge) end) == :ok
    id
  end

  defp mission(id), do: value(id, :mission)

  defp value(id, key),
    do: with({:ok, value, _at_ms} <- Board.fetch(Board.find!(id), key, :infinity), do: value)

  defp says(id), do: Swarm.status(id).says

  defp went_back(ids) do
    for id <- ids do
      assert_receive {_stage, %{stage: :replacement, what: :back, robot: ^id, says: says}}, 30_000
      says
    end
  end

  # A busy machine may answer too late, and take what is then given again for another one.
  defp given(to, code) do
    with {:error, line} <- order(fn -> Swarm.replace(to, code) end),
         do: assert(line =~ "is watched for 10 s first")
  end

  # The ten seconds are over.
  defp kept(id) do
    assert_receive {_stage, %{stage: :replacement, what: :kept, robot: ^id}}, 30_000
  end

  @tag long: true, realtime: :long
  test "new code comes, a newer one replaces it, a wrong one goes back to it, and a restart to the release" do
    [first, second, crash] =
      for {n, kind} <- [{1, :good}, {2, :good}, {3, :crash}],
          do: Versions.code(Ours.Version1, n, kind)

    id = replaceable(:vers_a)
    listen(id, [:robot, :stage])

    given(id, {:code, first, speed: 0.3})
    eventually(fn -> says(id) == "version 1" end)
    assert %{state: {Ours.Version1, :roll}, options: [speed: 0.3]} = mission(id)
    kept(id)

    assert Swarm.status(id).replaced =~
             ~r/^keeps Ours.Version1 \(code [0-9a-f]{8}\), given by .*@.*$/

    given(id, {:code, second})
    eventually(fn -> says(id) == "version 2" end)
    kept(id)

    given(id, {:code, crash})
    [says] = went_back([id])

    assert says =~
             ~r/^went back from Ours.Version1 \(code [0-9a-f]{8}\), given by .*: it ended on vers_a after \d\.\d s \(version 3 is wrong\)$/

    eventually(fn -> says(id) == "version 2" end)
    assert %{options: [speed: 0.2]} = mission(id)

    # As its supervisor starts it again.
    stop_supervised!(id)
    eventually(fn -> not :erlang.module_loaded(Ours.Version1) end)
    robot(id, replace: :code)
    assert order(fn -> Swarm.tell(id, "start") end) == :ok
    assert {StandMission, :stand} = mission(id).state
    assert Swarm.status(id).replaced == nil
  end

  for {kind, why} <- [
        push: ~r/it ended on vers_push1 after \d\.\d s/,
        init: ~r/its init fails: no state for \[speed: 0.2\]/,
        hang: ~r/its init does not return/
      ] do
    test "a version goes back on all robots of the node: #{kind}" do
      code =
        Versions.code(
          Module.concat(Ours.Version2, unquote(Macro.camelize("#{kind}"))),
          1,
          unquote(kind)
        )

      ids = for n <- 1..2, do: replaceable(:"vers_#{unquote(kind)}#{n}")
      for id <- ids, do: listen(id, [:robot, :stage])
      was = for id <- ids, do: mission(id).state
      assert was == [{StandMission, :stand}, {StandMission, :stand}]
      given(ids, {:code, code})
      says = went_back(ids)

      assert Enum.any?(
               says,
               &(String.replace(&1, "push2", "push1") =~ unquote(Macro.escape(why)))
             )

      for id <- ids, do: eventually(fn -> mission(id).state == {StandMission, :stand} end)
      for id <- ids, do: assert(mission(id).options == [formation: :wedge])
      {module, _beam} = hd(code)
      refute :erlang.module_loaded(module)
      # The next start is of the release's, too.
      for id <- ids, do: assert(value(id, :replaced).mission == nil)
    end
  end

  test "what came while a robot stood is watched from its first start, and gives way until then" do
    [good, crash] =
      for {n, kind} <- [{1, :good}, {2, :crash}], do: Versions.code(Ours.Version6, n, kind)

    id = replaceable(:vers_later)
    listen(id, [:robot, :stage])
    assert order(fn -> Swarm.stop(id) end) == :ok
    given(id, {:code, good})
    assert_receive {_stage, %{what: :replaced}}, 10_000
    given(id, {:code, crash})
    assert_receive {_stage, %{what: :replaced}}, 10_000
    assert mission(id).state == :idle

    assert order(fn -> Swarm.tell(id, "start") end) == :ok
    [says] = went_back([id])
    assert says =~ "(version 2 is wrong)"
    # Nothing ran before, so nothing is started; the next start is of what came first.
    assert mission(id).state == :idle
    assert order(fn -> Swarm.tell(id, "start") end) == :ok
    eventually(fn -> says(id) == "version 1" end)
  end

  test "options that the new code does not take, or does not know, leave all as it is" do
    code = Versions.code(Ours.Version3, 1)
    id = replaceable(:vers_opts)
    listen(id, [:robot, :stage])
    given(id, {:code, code, speed: 9})
    [says] = went_back([id])
    assert says =~ ": version3 option speed: expected a number from 0.05 to 0.5 m/s, got 9"
    eventually(fn -> mission(id).state == {StandMission, :stand} end)
    refute :erlang.module_loaded(Ours.Version3)
  end

  @tag long: true, realtime: :long
  test "new code of what another robot of the node runs goes to both, or to none" do
    [first, second] = for n <- 1..2, do: Versions.code(Ours.Version4, n)
    [a, b] = ids = for n <- 1..2, do: replaceable(:"vers_two#{n}")
    for id <- ids, do: listen(id, [:robot, :stage])
    given(ids, {:code, first})
    for id <- ids, do: eventually(fn -> says(id) == "version 1" end)
    for id <- ids, do: kept(id)

    assert order(fn -> Swarm.replace(a, {:code, second}) end) ==
             {:error,
              "#{b} runs Ours.Version4 on this node, too, and they share its code: give it to both"}

    given(ids, {:code, second})
    for id <- ids, do: eventually(fn -> says(id) == "version 2" end)

    # One whose power fails is no crash of the version, and does not take the code along.
    stop_supervised!(a)
    kept(b)
    assert says(b) == "version 2"
    stop_supervised!(b)
    eventually(fn -> not :erlang.module_loaded(Ours.Version4) end)
  end

  test "what a node's process leaves when it ends is not watched: the release comes back" do
    code = Versions.code(Ours.Version5, 1)
    id = replaceable(:vers_left)
    given(id, {:code, code})
    eventually(fn -> says(id) == "version 1" end)
    Process.exit(Process.whereis(Replacement.Server), :kill)
    eventually(fn -> mission(id).state == :idle end)
    eventually(fn -> Swarm.status(id).replaced =~ "has its own mission again" end)
    assert order(fn -> Swarm.tell(id, "start") end) == :ok
    assert {StandMission, :stand} = mission(id).state
  end
end
