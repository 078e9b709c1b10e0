defmodule Console.PromptTest do
  use ExUnit.Case, async: true
  alias Console.Prompt
  alias Console.Terminal.Editor

  @robots [:mag1, :mag2, :min1]

  defp ok(text) do
    {:ok, command} = Prompt.parse(text, @robots)
    command
  end

  defp error(text) do
    {:error, line} = Prompt.parse(text, @robots)
    line
  end

  test "every command is understood" do
    assert ok("") == :nothing
    assert ok("kill leader") == {:kill, :leader}
    assert ok("  KILL mag2 ") == {:kill, :mag2}
    assert ok("formation wedge 1.2") == {:formation, {:wedge, 1.2}}
    assert ok("formation wedge:1.2") == {:formation, {:wedge, 1.2}}
    assert ok("formation line") == {:formation, {:line, nil}}
    assert ok("landmark 3,2") == {:landmark, {3.0, 2.0}}
    assert ok("landmark -3, 2") == {:landmark, {-3.0, 2.0}}
    assert ok("move 3 2") == {:landmark, {3.0, 2.0}}
    assert ok("landmark none") == {:landmark, :none}
    assert ok("place mag2 1,-2") == {:place, :mag2, {1.0, -2.0}}
    assert ok("place ball1 0.5 2") == {:place, "ball1", {0.5, 2.0}}
    assert ok("goto mag2 1,2") == {:tell, [:mag2], {:goto, 1.0, 2.0, nil}}
    assert ok("follow min1 mag2") == {:tell, [:min1], {:follow_the_leader, :mag2}}
    assert ok("stop") == {:tell, :all, :stop}
    assert ok("stop min1") == {:tell, [:min1], :stop}
    assert ok("start") == {:tell, :all, :start}
    assert ok("start all") == {:tell, :all, :start}
    assert ok("start mag2") == {:tell, [:mag2], :start}

    assert ok("start patrol:period=90,loop=line") ==
             {:tell, :all, {:start, "patrol:period=90,loop=line"}}

    assert ok("start mag2 landmark:formation=wedge:1.2") ==
             {:tell, [:mag2], {:start, "landmark:formation=wedge:1.2"}}

    assert ok("start:patrol") == {:tell, :all, {:start, "patrol"}}
    assert ok("replace flock") == {:tell, :all, {:replace, "flock"}}
    assert ok("replace all flock") == {:tell, :all, {:replace, "flock"}}
    assert ok("replace mag2 patrol:period=90") == {:tell, [:mag2], {:replace, "patrol:period=90"}}
    assert ok("mag2 replace:flock") == {:tell, [:mag2], {:replace, "flock"}}
    assert ok("mag2 run:drift") == {:tell, [:mag2], {:run, "drift"}}
    assert ok("mag2 wander") == {:tell, [:mag2], :wander}
    assert ok("all square:2") == {:tell, :all, {:square, 2.0}}
    assert ok("mag2 move:0.2:0.1") == {:tell, [:mag2], {:move, 0.2, 0.1}}
    assert ok("mag2 MOVE 0.2 0.1") == {:tell, [:mag2], {:move, 0.2, 0.1}}
    assert ok("all findblob") == {:tell, :all, {:find_blob, nil}}
    assert ok("goto:1:2") == {:tell, :all, {:goto, 1.0, 2.0, nil}}
    assert ok("estop") == :estop
    assert ok("reset") == :reset
    assert ok("status") == :status
    assert ok("status mag1") == {:status, :mag1}
    assert ok("help") == :help
    assert ok("quit") == :quit
  end

  test "a stop that is typed nearly right stops, and the answer says as what it was taken" do
    for line <-
          [
            "estop all",
            "estop now",
            "estop!",
            "e-stop",
            "eestop",
            "E STOP",
            "emergency stop",
            "halt",
            "HALT!!"
          ] ++
            [
              "emergency",
              "etsop",
              "estp",
              "estoppp",
              "mag1 estop",
              "all estop",
              "estop mag9",
              "halt mag1"
            ],
        do: assert({line, ok(line)} == {line, :estop})

    for line <- [
          "stop all",
          "stop!",
          "STOP NOW",
          "stop all robots",
          "stpo",
          "sotp",
          "stopp",
          "all stop",
          "stop, stop"
        ],
        do: assert({line, ok(line)} == {line, {:tell, :all, :stop}})

    assert ok("stop mag1, min1") == {:tell, [:mag1, :min1], :stop}
    assert ok("mag2 stop!") == {:tell, [:mag2], :stop}

    for line <- ["disarm", "disarm all", "disarm now"],
        do: assert(ok(line) == {:tell, :all, :disarm})

    assert ok("disarm mag2") == {:tell, [:mag2], :disarm}

    assert Prompt.said("emergency stop", :estop) == "emergency stop (estop)"
    assert Prompt.said("stpo", ok("stpo")) == "stpo (stop all)"

    # What cannot be one names what always works; what is like another word is that word.
    for line <- ["stop mag9", "stop the music", "kill estop", "formation halt", "disarm mag9"],
        do: assert({line, error(line) =~ "; F8 and estop stop all robots"} == {line, true})

    for {line, command} <- [{"step", {:pace, {:step, 1}}}, {"start", {:tell, :all, :start}}],
        do: assert(ok(line) == command)

    assert error("stat") =~ "did you mean"
    refute error("kil leader") =~ "F8"
  end

  test "F8 is the emergency stop, at the prompt and while a robot is driven" do
    press = fn keys, reader ->
      Enum.map_reduce(keys, reader, fn key, reader ->
        case reader do
          %Editor{} -> Editor.key(reader, key)
          keys -> Console.Teleop.Keys.key(keys, key)
        end
      end)
    end

    f8 = String.graphemes("\e[19~")

    assert {[nil, nil, nil, nil, :estop], %Editor{} = editor} =
             press.(["\e", "[", "1", "9", "~"], Editor.new([]))

    assert Editor.text(editor) == ""
    assert {[nil, nil, nil, nil, :estop], keys} = press.(f8, Console.Teleop.Keys.new(:mag1))
    assert {[{:word, _ahead}], _keys} = press.(["w"], keys)
    # F5 and F9 are none.
    for other <- ["\e[15~", "\e[20~"],
        reader <- [Editor.new([]), Console.Teleop.Keys.new(:mag1)] do
      {events, _reader} = press.(String.graphemes(other), reader)
      refute :estop in events
    end
  end

  test "errors name what is wrong and what is allowed" do
    assert error("kil leader") =~ "did you mean kill?"

    assert error("start patorl") =~
             "expected one of landmark, patrol, flock, explore, chase, push, teleop; did you mean patrol?"

    assert error("start mga2") =~ "did you mean mag2?"
    assert error("start patrol:perod=9") =~ "did you mean period?"
    assert error("start mag2 patorl") =~ "did you mean patrol?"
    assert error("start mag9 patrol") =~ "there are mag1 to mag2, min1"
    assert error("replace patorl") =~ "did you mean patrol?"
    assert error("replace mag9 patrol") =~ "there are mag1 to mag2, min1"
    assert error("replace") =~ "replace mag1 patrol:period=90"
    assert error("kill mag9") =~ "there are mag1 to mag2, min1"
    assert error("kill") =~ "kill leader"
    assert error("formation vee") =~ "column, line, wedge"
    assert error("formation wedge 9") =~ "0.8 to 5"
    assert error("formation") =~ "needs a kind"
    assert error("landmark nan,1") =~ "X,Y in metres"
    assert error("landmark") =~ "X,Y in metres"
    assert error("place") =~ "place mag1 1,2"
    assert error("place mag1") =~ "place mag1 1,2"
    assert error("place mag9 1,2") =~ "there are mag1 to mag2, min1"
    assert error("place box1 1,here") =~ "X,Y in metres"
    assert error("goto mag1") =~ "goto mag1 1,2"
    assert error("goto mag1 inf,0") =~ "X,Y in metres"
    assert error("follow mag1 mag1") =~ "itself"
    assert error("mag1 goto:abc:1") =~ ~r/x: expected .*, got "abc"/
    assert error("goto:1") =~ "y is missing"
    assert error("all fly:1") =~ ~s(, got "fly")
    assert error("mag1 followtheleader:mag9") =~ "mag9"
    assert error("xyzzy") =~ "help"
  end

  test "a line of ten thousand letters is refused, not repeated" do
    assert error(String.duplicate("a", 10_000)) ==
             "expected a line of at most 500 bytes"

    # What the editor keeps of it is refused as well, and never taken for a shorter command.
    typed =
      for _ <- 1..10_000, reduce: %{Editor.new([]) | most: Prompt.most_bytes()} do
        editor -> editor |> Editor.key("é") |> elem(1)
      end

    assert byte_size(Editor.text(typed)) in 501..502
    assert {{:line, line}, after_it} = Editor.key(typed, "\r")
    assert error(line) =~ "at most 500 bytes"
    assert after_it.most == Prompt.most_bytes()
  end

  test "behaviours of a build are run by their names" do
    Application.put_env(:swarm, :behaviours, drift: Robot.Behaviour.Wander)
    on_exit(fn -> Application.delete_env(:swarm, :behaviours) end)
    assert ok("run mag2 drift") == {:tell, [:mag2], {:run, "drift"}}
    assert ok("run all drift") == {:tell, :all, {:run, "drift"}}
    assert error("run mag2 dirft") =~ "expected drift; did you mean drift?"
    assert error("run drift") == "run needs a name and a behaviour: run mag1 drift"
    assert error("start drift") =~ "drift is a behaviour: run:drift"
    assert "drift" in Prompt.completions(["run", "mag2"], @robots)
  end

  test "names of missions are completed, and the help has them" do
    assert Prompt.completions(["start"], [:mag1]) == [
             "landmark",
             "patrol",
             "flock",
             "explore",
             "chase",
             "push",
             "teleop",
             "mag1"
           ]

    assert Prompt.completions(["start", "mag1"], [:mag1]) == [
             "landmark",
             "patrol",
             "flock",
             "explore",
             "chase",
             "push",
             "teleop"
           ]

    assert Prompt.completions(["start", "patrol"], [:mag1]) == []

    assert Enum.join(Prompt.help(), "\n") =~
             ~r"starts another mission:\n +landmark, patrol, flock, explore"
  end
end
