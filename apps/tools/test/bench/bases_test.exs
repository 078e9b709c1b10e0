defmodule Bench.BasesTest do
  use ExUnit.Case, async: false
  alias Bench.Bases
  @moduletag :realtime
  @moduletag :tmp_dir
  @moduletag timeout: 300_000
  doctest Bench.Bases
  doctest Bench.Bases.Main

  # How fast they stop is for the benchmark to measure, on a machine with nothing else to do.
  test "the wheels of every base stand after what its driver promises", %{tmp_dir: folder} do
    for base <- Bases.bases(), cause <- [:kill, :freeze, :program] do
      [ms] = Bases.Runner.run(base, cause, 1, folder)
      assert {base.name, cause, is_integer(ms)} == {base.name, cause, true}
    end
  end

  test "with nothing left to stop it, a base stands by its own time-out, or drives on", %{
    tmp_dir: folder
  } do
    {:ok, bases} = Bases.choose("kobuki,turtlebot3,create,arduino")

    for base <- bases do
      [ms] = Bases.Runner.run(base, :both, 1, folder)
      assert {base.name, is_integer(ms)} == {base.name, base.name in [:turtlebot3, :arduino]}
    end
  end
end
