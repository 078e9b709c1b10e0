defmodule Console.LiveTest do
  use ExUnit.Case, async: true
  doctest Console.Pace
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
    assert {:ok, _} = Live.Trial.command(live, {:tell, [:mag1], :stop})
    assert {:ok, _} = Live.Trial.command(live, :estop)
    assert Live.Trial.command(live, {:tell, [:mag1], {:goto, 1, 2, nil}}) == {:error, "mag1: no"}
    assert {:error, line} = Live.Trial.command(live, {:tell, :all, :arm})
    assert line =~ "no wheels to arm"
    assert Live.Trial.result(live).robots == 3
  end

  test "robots answer in lockstep as they do live" do
    line = "--robots 2 --plan known --seed 3"
    {:ok, live} = Live.Trial.start_link(Lab.Trial, Options.trial(Runs.options(line)))
    assert {:ok, _paused} = Live.Trial.command(live, {:pace, :pause})

    tell = fn to, text ->
      {:ok, command} = Robot.Command.parse(text, [:mag1, :min1])
      Live.Trial.command(live, {:tell, to, command})
    end

    assert tell.([:mag1], "goto:99:0") ==
             {:error, "mag1 cannot go to 99.0,0.0: it is outside of the map"}

    assert tell.([:min1], "followtheleader:min1") == {:error, "min1 cannot follow itself"}
    assert {:error, line} = tell.([:mag1], "findblob:pink")
    assert line =~ "mag1 does not know the colour \"pink\"; it looks for "

    assert {:error, "in lockstep no mission is replaced" <> _} =
             Live.Trial.command(live, {:tell, [:mag1], {:replace, "flock"}})

    assert Live.Trial.command(live, {:place, :mag1, {99.0, 0.0}}) ==
             {:error, "mag1 cannot be put at 99.0,0.0: there is no room"}

    assert Live.Trial.command(live, {:place, "ball1", {0.0, 0.0}}) ==
             {:error, "there is no ball1"}

    assert {:ok, _done} = Live.Trial.command(live, {:place, :mag1, {3.0, 3.0}})

    assert tell.([:mag1], "square:2") == {:ok, "accepted"}
    assert %{state: :manual} = Enum.find(Live.Trial.scene(live).robots, &(&1.id == :mag1))
    assert Live.Trial.command(live, {:formation, {:wedge, 1.2}}) == {:ok, "accepted"}

    assert Live.Trial.command(live, :estop) == {:ok, "accepted"}
    held = "mag1 is held by the emergency stop; reset it first"
    assert tell.([:mag1], "rest") == {:error, held}
    assert Live.Trial.command(live, :reset) == {:ok, "accepted"}
    assert tell.(:all, "start") == {:ok, "accepted"}
  end

  test "a person writes to the robots' mission: what its table allows, of a kind that it hears from people" do
    line = "--robots 2 --mission flock:course=[{0,0},{3,0},{6,0}] --landmark none --seed 3"
    options = Options.trial(Runs.options(line))
    {:ok, live} = Live.Trial.start_link(Lab.Trial, options, Console.Pace.new(:max))
    assert {:ok, _paused} = Live.Trial.command(live, {:pace, :pause})

    tell = fn text ->
      with {:ok, command} <- Console.Prompt.parse(text, [:mag1, :min1]),
           do: Live.Trial.command(live, command)
    end

    for {text, line} <- [
          {"send mag1 leg:leg=99",
           "mag1: message leg option leg: expected a whole number from 1 to 65, got 99"},
          {"send mag1 leg:leg=far",
           "mag1: message leg option leg: expected a whole number from 1 to 65, got :far"},
          {"send mag1 leg", "mag1: message leg option leg is missing"},
          {"mag1 send:leg:leg=2,pace=3", "mag1: message leg option pace is not known"},
          {"send mag1 leg:2", ~s(mag1: leg: expected KEY=VALUE,…, got "2")},
          {"send mag1 leg:leg=" <> String.duplicate("é", 200),
           "mag1: message leg option leg: expected"},
          {"send mag1 lag:leg=2",
           ~s(mag1: flock hears of people leg, not "lag"; did you mean leg?)},
          # What robots tell each other is no person's to say.
          {"send mag1 member:plan=1,leg=2", ~s(mag1: flock hears of people leg, not "member")},
          {"send mag9 leg:leg=2", ~s(no robot "mag9")},
          {"send mag1", "send needs a name, or all, and a message"},
          {"mag1 send", "send: kind is missing: expected send:KIND or send:KIND:FIELDS"}
        ] do
      assert {:error, told} = tell.(text)
      assert String.starts_with?(told, line), told
    end

    refute Enum.any?(said(live), &(&1.from == "a person"))
    assert tell.("send mag1 leg:leg=2") == {:ok, "accepted"}

    assert [%{to: [:mag1], text: "leg:leg=2", count: 1}] =
             for(%{from: "a person"} = row <- said(live), do: row)

    # The answer: it tells the others, and they tell it on.
    assert {:ok, _steps} = Live.Trial.command(live, {:pace, {:step, 5}})

    passed_on(live, [:mag1, :min1])

    # As all other orders.
    assert tell.("estop") == {:ok, "accepted"}
    assert {:error, line} = tell.("send all leg:leg=3")
    assert line =~ "mag1 is held by the emergency stop; reset it first"
    assert tell.("reset") == {:ok, "accepted"}
    assert {:error, line} = tell.("send mag1 leg:leg=3")
    assert line == "mag1: it has no mission that could hear a message; start it first"
    assert tell.("start patrol") == {:ok, "accepted"}
    assert tell.("send mag1 leg:leg=3") == {:error, "mag1: patrol hears no messages of people"}
  end

  # Returns once these robots have told the others of leg 2.
  defp passed_on(live, robots) do
    told = for %{from: id, text: "member" <> rest} <- said(live), rest =~ "leg 2", do: id
    if robots -- told != [], do: passed_on(live, robots)
  end

  defp said(live) do
    {:ok, rows} = Live.Trial.messages(live)
    rows
  end

  # What a run shows once it has paused by itself, or is ahead.
  defp until(live, shows?) do
    pace = Live.Trial.pace(live)
    scene = Live.Trial.scene(live)
    if shows?.(scene, pace), do: scene, else: until(live, shows?)
  end

  test "it pauses, steps, and goes on at another speed; the run is the same" do
    options = Options.trial(Runs.options("--robots 3 --seed 4"))
    {:ok, live} = Live.Trial.start_link(FakeTrial, options, Console.Pace.new(:max))
    _ahead = until(live, fn scene, _pace -> scene.at_ms >= 1_000 end)
    assert {:ok, "paused" <> _} = Live.Trial.command(live, {:pace, :pause})
    paused = Live.Trial.scene(live)
    assert {:ok, "7 steps left"} = Live.Trial.command(live, {:pace, {:step, 7}})
    stepped = until(live, fn _scene, pace -> pace.left == 0 end)
    assert stepped.at_ms == paused.at_ms + 700
    assert {:ok, "paused, then 10.0x"} = Live.Trial.command(live, {:pace, {:speed, 10.0}})
    assert {:ok, "10.0x asked"} = Live.Trial.command(live, {:pace, :resume})
    _on = until(live, fn scene, _pace -> scene.at_ms >= stepped.at_ms + 500 end)
    assert {:ok, "paused, then 10.0x"} = Live.Trial.command(live, {:pace, :pause})
    scene = Live.Trial.scene(live)

    {:ok, straight} = FakeTrial.new(options)
    steps = div(scene.at_ms, 100)

    assert scene ==
             FakeTrial.scene(Enum.reduce(1..steps, straight, fn _, t -> FakeTrial.step(t) end))
  end

  test "a pace that is asked for twice, or steps of a run that goes on, are refused" do
    live = start("--robots 2")
    assert {:error, "it is not paused"} = Live.Trial.command(live, {:pace, :resume})
    assert {:error, "it goes on" <> _} = Live.Trial.command(live, {:pace, {:step, 1}})
    assert {:ok, "paused"} = Live.Trial.command(live, {:pace, :pause})
    assert {:error, "it is paused already"} = Live.Trial.command(live, {:pace, :pause})
  end

  test "a run that cannot be made says why" do
    options = Map.put(Options.trial(Runs.options("")), :map, "nowhere")
    assert {:error, "the map" <> _} = Live.Trial.start_link(FakeTrial, options)
  end
end
