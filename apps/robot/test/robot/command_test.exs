defmodule Robot.CommandTest do
  use ExUnit.Case, async: true
  alias Hal.Pose
  alias Robot.Command
  doctest Robot.Command
  doctest Robot.Command.Arguments

  @known [:mag1, :min1, :player1]

  test "reads the whole grammar in any case" do
    for {text, command} <- [
          {"stop", :stop},
          {" Stop ", :stop},
          {"MOVE:0.3:-0.1", {:move, 0.3, -0.1}},
          {"goto:2:1", {:goto, 2.0, 1.0, nil}},
          {"goto: 2 : 1 :1.5", {:goto, 2.0, 1.0, 1.5}},
          {"followtheleader:player1", {:follow_the_leader, :player1}},
          {"FindBlob", {:find_blob, nil}},
          {"findblob:YellowLandmark", {:find_blob, "YellowLandmark"}},
          {"subscribe:min1", {:subscribe, :min1}},
          {"unsubscribe:min1", {:unsubscribe, :min1}},
          {"position:1:2:0.5", {:position, Pose.new(1, 2, 0.5)}},
          {"follow:1:2:0.5", {:follow, Pose.new(1, 2, 0.5)}},
          {"blob:1:2:0:0.01:1", {:blob, Pose.new(1, 2), 0.01, true}},
          {"blob:1:2:0:0:0", {:blob, Pose.new(1, 2), 0.0, false}},
          {"lead", :lead},
          {"start", :start},
          {"Start:Patrol", {:start, "Patrol"}},
          {"start:patrol:formation=wedge:1.2", {:start, "patrol:formation=wedge:1.2"}},
          {"wander", :wander},
          {"rest", :rest},
          {"square", {:square, nil}},
          {"square:2", {:square, 2.0}},
          {"ping", :ping},
          {"arm", :arm},
          {"DisArm", :disarm},
          {"acknowledge", :acknowledge},
          {"move:.5:+1.", {:move, 0.5, 1.0}},
          {"move:1e-400:0e400", nil},
          {"move:1e-99:0e99", {:move, 0.0, 0.0}}
        ] do
      if command, do: assert({:ok, command} == Command.parse(text, @known), text)
    end
  end

  test "what is wrong is named, with what is allowed" do
    for {text, line} <- [
          {"", ~r/empty command/},
          {"goto:nan:1", ~r/x: expected a number/},
          {"goto:1:inf", ~r/y: expected .*, got "inf"/},
          {"goto:1:-Infinity", ~r/y: expected/},
          {"goto:1e400:1", ~r/x: expected/},
          {"goto:1e99:1", ~r/-1000000 to 1000000/},
          {"goto:9999999:1", ~r/-1000000 to 1000000/},
          {"goto:1,5:1", ~r/x: expected .*, got "1,5"/},
          {"goto:0x10:1", ~r/x: expected/},
          {"goto:1_0:1", ~r/x: expected/},
          {"goto::1", ~r/x: expected .*, got ""/},
          {"goto:1:2:3:4", ~r/expected goto:X:Y or goto:X:Y:THETA, got also "4"/},
          {"stop:1", ~r/expected stop, got also "1"/},
          {"move:1", ~r/w is missing: expected move:V:W/},
          {"start:", ~r/mission: expected .*, got ""/},
          {"run", ~r/behaviour is missing: expected run:BEHAVIOUR or run:BEHAVIOUR:OPTIONS/},
          {"run:", ~r/behaviour: expected a behaviour's name, got ""/},
          {"square:big", ~r/side: expected .*, got "big"/},
          {"wander:1", ~r/expected wander, got also "1"/},
          {"followtheleader:a:b", ~r/got also "b"/},
          {"followtheleader:nobody", ~r/expected one of mag1, min1, player1, got "nobody"/},
          {"followtheleader:", ~r/name: expected .*, got ""/},
          {"blob:1:2:0:-1:1", ~r/size: expected .*, got "-1"/},
          {"blob:1:2:0:1:yes", ~r/0 or 1/},
          {"halt", ~r/got "halt"/},
          {"folow:1:2:3", ~r/did you mean follow\?/},
          {"qqqq", ~r/one of stop, move/},
          {<<255, 1>>, ~r/not text/},
          {String.duplicate("a", 501), ~r/at most 500 bytes/},
          {:stop, ~r/expected a command as text/}
        ] do
      assert {:error, message} = Command.parse(text, @known)
      assert message =~ line
      refute message =~ "\n"
    end
  end

  test "rubbish neither crashes nor makes atoms" do
    Command.parse("goto:1:2", @known)

    pieces =
      Command.keywords() ++
        ["1", "-", ".", "e", "1e9999999", "nan", "mag1", "ä", " ", "\n", <<200>>]

    for k <- 1..3000 do
      text =
        for _ <- 1..:rand.uniform(6),
            into: "",
            do: Enum.random(pieces) <> Enum.random([":", "", "::"])

      text = if rem(k, 3) == 0, do: :crypto.strong_rand_bytes(:rand.uniform(40)), else: text
      new = "new#{k}_#{:rand.uniform(1_000_000_000)}"
      strange = Enum.reject([text, new | String.split(text, ":")], &atom?/1)
      assert {kind, _} = Command.parse(text, @known)
      assert kind in [:ok, :error]
      assert {:error, _line} = Command.parse("#{new}:#{new}", @known)
      assert {:error, _line} = Command.parse("goto:#{new}:1", @known)
      refute Enum.any?(strange, &atom?/1)
    end
  end

  # Of these words, and not how many atoms there are: other tests make some meanwhile.
  defp atom?(word) do
    is_atom(String.to_existing_atom(word))
  rescue
    ArgumentError -> false
  end
end
