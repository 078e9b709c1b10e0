defmodule Swarm.Replacement.ReturnTest do
  @moduledoc "Robots of this node with fake wheels go back from a mission that is not fit for them."
  use Swarm.Case, async: false
  alias Swarm.{Replacement, StandMission, UnfitMission}
  @moduletag :capture_log
  @moduletag :realtime

  setup do
    # Nobody watches what the test before has left.
    :ok = :sys.terminate(Process.whereis(Replacement.Server), :normal)
    eventually(fn -> Process.whereis(Replacement.Server) end)
    :ok
  end

  defp replaceable(id) do
    robot(id, replace: true)
    standing([id])
    assert order(fn -> Swarm.start(StandMission, robots: [id], formation: :wedge) end) == :ok
    id
  end

  defp mission(id), do: value(id, :mission)

  defp value(id, key),
    do: with({:ok, value, _at_ms} <- Board.fetch(Board.find!(id), key, :infinity), do: value)

  defp went_back(ids) do
    for id <- ids do
      assert_receive {_stage, %{stage: :replacement, what: :back, robot: ^id, says: says}}, 30_000
      says
    end
  end

  # A busy machine may answer too late, and take what is then given again for another one.
  defp given(to, options) do
    with {:error, line} <- order(fn -> Swarm.replace(to, {UnfitMission, options}) end),
         do: assert(line =~ "is watched for 10 s first")
  end

  defp rolls(id), do: eventually(fn -> match?({UnfitMission, :roll}, mission(id).state) end)

  for {does, why} <- [
        crash: ~r/it ended on back_crash1 after \d\.\d s \(it is wrong\)/,
        push: ~r/it ended on back_push1 after \d\.\d s/,
        init: ~r/its init fails: no state for \[speed: 0.2, does: :init\]/,
        hang: ~r/its init does not return/
      ] do
    test "a mission goes back on all robots of the node: #{does}" do
      ids = for n <- 1..2, do: replaceable(:"back_#{unquote(does)}#{n}")
      for id <- ids, do: listen(id, [:robot, :stage])
      was = for id <- ids, do: mission(id).state
      assert was == [{StandMission, :stand}, {StandMission, :stand}]
      given(ids, does: unquote(does))
      says = went_back(ids)

      assert Enum.any?(
               says,
               &(String.replace(&1, "#{unquote(does)}2", "#{unquote(does)}1") =~
                   unquote(Macro.escape(why)))
             )

      for id <- ids, do: eventually(fn -> mission(id).state == {StandMission, :stand} end)
      for id <- ids, do: assert(mission(id).options == [formation: :wedge])
      # The next start is of the release's, too.
      for id <- ids, do: assert(value(id, :replaced).mission == nil)
    end
  end

  test "what came while a robot stood is watched from its first start, and gives way until then" do
    id = replaceable(:back_later)
    listen(id, [:robot, :stage])
    assert order(fn -> Swarm.stop(id) end) == :ok
    given(id, speed: 0.3)
    assert_receive {_stage, %{what: :replaced}}, 10_000
    given(id, does: :crash)
    assert_receive {_stage, %{what: :replaced}}, 10_000
    assert mission(id).state == :idle

    assert order(fn -> Swarm.tell(id, "start") end) == :ok
    [says] = went_back([id])
    assert says =~ "(it is wrong)"
    # Nothing ran before, so nothing is started; the next start is of what came first.
    assert mission(id).state == :idle
    assert order(fn -> Swarm.tell(id, "start") end) == :ok
    rolls(id)
    assert mission(id).options[:speed] == 0.3
  end

  test "a robot that starts again has its own mission" do
    id = replaceable(:back_anew)
    given(id, [])
    rolls(id)
    # As its supervisor starts it again.
    stop_supervised!(id)
    robot(id, replace: true)
    assert order(fn -> Swarm.tell(id, "start") end) == :ok
    assert {StandMission, :stand} = mission(id).state
    assert Swarm.status(id).replaced == nil
  end

  test "what a node's process leaves when it ends is not watched: the release comes back" do
    id = replaceable(:back_left)
    given(id, [])
    rolls(id)
    Process.exit(Process.whereis(Replacement.Server), :kill)
    eventually(fn -> mission(id).state == :idle end)
    eventually(fn -> Swarm.status(id).replaced =~ "has its own mission again" end)
    assert order(fn -> Swarm.tell(id, "start") end) == :ok
    assert {StandMission, :stand} = mission(id).state
  end
end
