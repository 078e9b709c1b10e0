defmodule Bench.BasesTest do
  use ExUnit.Case, async: false
  alias Bench.Bases
  @moduletag :realtime
  @moduletag :tmp_dir
  doctest Bench.Bases
  doctest Bench.Bases.Main

  # How fast they stop is for the benchmark to measure, on a machine with nothing else to do.
  test "the wheels of every base stand after what its driver promises", %{tmp_dir: folder} do
    for base <- Bases.bases(), cause <- [:stop, :silence, :kill, :freeze, :program] do
      run = Bases.Runner.run(base, cause, 1, folder)
      assert [ms] = run
      assert is_integer(ms), inspect({base.name, cause, run})
    end
  end

  test "a base without a time-out of its own drives on when nothing is left to stop it", %{
    tmp_dir: folder
  } do
    {:ok, [kobuki]} = Bases.choose("kobuki")
    assert Bases.Runner.run(kobuki, :pull, 1, folder) == [nil]
  end
end
