defmodule Lab.Hardware.FreezeTest do
  @moduledoc "A VM of robots on real drivers is frozen while they drive, and thawed: none drives on by itself."
  use ExUnit.Case, async: true
  import Swarm.Case, only: [eventually: 1]
  import Lab.VmRobots
  @moduletag :realtime
  @moduletag :tmp_dir
  @moduletag :capture_log

  @robots [frozen_manual: :manual, frozen_auto: :auto]
  @ids Keyword.keys(@robots)

  defp stand_after_freezes(folder, freezes) do
    robots = start(@robots, folder)
    for ms <- freezes, do: stand_after_freeze(robots, ms)
  end

  defp stand_after_freeze(robots, ms) do
    for id <- @ids, do: roll(robots, id)
    signal(robots, "STOP")
    pass(ms)
    # The last words were said long ago; what was written before them has come.
    since_ms = now_ms() - 50
    signal(robots, "CONT")
    stand(robots, since_ms, ms)
  end

  defp stand(robots, since_ms, ms) do
    moved = fn -> Enum.find(@ids, &(moves(robots, &1, since_ms) != [])) end
    drove = watch(1_500, moved)
    assert {ms, drove} == {ms, nil}

    # The wheels turned when they were stopped: a person looks, and acknowledges.
    eventually(fn ->
      match?(%{arming: {:error, :last_words}, state: :idle}, status(robots, :frozen_manual))
    end)

    eventually(fn -> match?(%{arming: :armed, state: :idle}, status(robots, :frozen_auto)) end)
    assert {:error, line} = swarm(robots, :arm, [:frozen_manual])
    assert line =~ "acknowledge"
    assert moved.() == nil
    for id <- @ids, do: assert(still?(robots, id))
  end

  test "whatever the length of the freeze, goal and order are gone, and a person arms", %{
    tmp_dir: folder
  } do
    stand_after_freezes(folder, [300, 1_950, 2_500])
  end

  test "a VM that is frozen together with its port programs, and thaws before them, drives no more either",
       %{
         tmp_dir: folder
       } do
    robots = start(@robots, folder)
    for id <- @ids, do: roll(robots, id)
    programs = for id <- @ids, do: port_program(robots, id)
    # Whatever becomes of the test, nothing is left behind frozen.
    on_exit(fn -> Vm.signal(programs, "CONT") end)
    signal(robots, "STOP")
    Vm.signal(programs, "STOP")
    pass(1_000)
    since_ms = now_ms() - 50
    signal(robots, "CONT")
    pass(150)
    Vm.signal(programs, "CONT")
    stand(robots, since_ms, 1_000)
  end

  @tag long: true, realtime: :long, timeout: 600_000
  test "of 40 freezes of 0.3 to 4 s", %{tmp_dir: folder} do
    stand_after_freezes(folder, for(_ <- 1..40, do: 299 + :rand.uniform(3_701)))
  end
end
