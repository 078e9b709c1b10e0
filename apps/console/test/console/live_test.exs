defmodule Console.LiveTest do
  use ExUnit.Case, async: true
  alias Console.{FakeTrial, Live, Options, Runs}

  defp start(line) do
    {:ok, live} = Live.Trial.start_link(FakeTrial, Options.trial(Runs.options(line)))
    live
  end

  test "shows the run and takes commands" do
    live = start("--robots 3")
    assert length(Live.Trial.scene(live).robots) == 3
    assert {:ok, _} = Live.Trial.command(live, {:kill, :mag2})
    assert {:error, "mag2 is already dead"} = Live.Trial.command(live, {:kill, :mag2})
    assert {:error, "there is no leader" <> _} = Live.Trial.command(live, {:kill, :leader})
    assert {:ok, _} = Live.Trial.command(live, {:formation, {:wedge, nil}})
    assert Live.Trial.scene(live).formation == {:wedge, 1.0}
    assert {:ok, _} = Live.Trial.command(live, {:landmark, {3.0, 2.0}})
    assert {:error, "there is a wall"} = Live.Trial.command(live, {:landmark, {30.0, 2.0}})
    assert {:ok, _} = Live.Trial.command(live, {:tell, [:mag1], "stop"})
    assert {:ok, _} = Live.Trial.command(live, :estop)
    assert {:error, line} = Live.Trial.command(live, {:tell, :all, "goto:1:2"})
    assert line =~ "goto:1:2"
    assert Live.Trial.result(live).robots == 3
  end

  test "a run that cannot be made says why" do
    options = Map.put(Options.trial(Runs.options("")), :map, "nowhere")
    assert {:error, "the map" <> _} = Live.Trial.start_link(FakeTrial, options)
  end
end
