defmodule Lab.MissionCaseTest do
  @moduledoc "What must hold for every mission holds for those in the box, and is seen where it does not."
  use Lab.LockstepCase, async: true
  alias Lab.MissionCase

  test "the landmark mission" do
    assert MissionCase.problems(:landmark, seeds: 1..2, seconds: 30) == []
  end

  test "the mission of a robot that a person drives",
    do: assert(MissionCase.problems(:teleop, seeds: [1], seconds: 10) == [])

  test "the patrol, which never has more than one robot's own points in its hand" do
    distinct = fn trial ->
      points =
        for id <- Lab.Trial.living(trial),
            do: Swarm.Member.runner(Lab.Trial.robot(trial, id)).mission.motivation.active

      if Enum.all?(points, &(&1 in [nil | Enum.to_list(0..7)])),
        do: :ok,
        else: "a point that is none"
    end

    assert MissionCase.problems({:patrol, period: 60}, always: distinct) == []
  end

  defmodule Wrong do
    @moduledoc "A mission with the fault that its option names."
    @behaviour Robot.Mission

    defmodule Said do
      @moduledoc "What its heartbeats say."
      defstruct count: 0
      def valid?(%{count: count}), do: is_integer(count) and count >= 0
    end

    @impl Robot.Mission
    def claims, do: {1, Said}

    @impl Robot.Mission
    def option_table,
      do: [fault: {:one_of, [:grows, :random, :gullible, :claims, :layer, :none, :lost]}]

    @impl Robot.Mission
    def messages, do: {1, [word: [text: {:text, "a word"}]]}

    @impl Robot.Mission
    def init(_robot, options), do: {:idle, {options[:fault], []}, []}

    @impl Robot.Mission
    def layer({:layer, _state}), do: [{:lines, "no such thing", []}]
    def layer(_mission), do: []

    @impl Robot.Mission
    def halted({:lost, _state}), do: nil
    def halted({fault, _state}), do: {fault, []}

    @impl Robot.Mission
    def handle({:command, :start}, mission), do: {:go, mission, []}

    def handle({:tick, _percept}, {:grows, state}),
      do: {:go, {:grows, Enum.to_list(1..100) ++ state}, []}

    def handle({:tick, _percept}, {:random, state}),
      do: {:go, {:random, state}, [{:tell, :all, :word, text: inspect(make_ref())}]}

    def handle({:tick, _percept}, {:claims, state}),
      do: {:go, {:claims, state}, [{:claim, %{count: -1}}]}

    def handle(_event, mission), do: {:go, mission, [{:claim, %{phase: :go, standing: true}}]}
  end

  test "faults are named" do
    for {fault, line} <- [
          {:grows, ~r/the state of mag1 grows: \d+ words in the middle/},
          {:random, ~r/the second run of the same seed was another/},
          {:claims, ~r/it sends a heartbeat that is not whole/},
          {:layer, ~r/its layer has {:lines, "no such thing", \[\]}, which is not drawn/}
        ] do
      assert [_ | _] =
               lines = MissionCase.problems({Wrong, fault: fault}, seeds: [1], seconds: 12)

      assert Enum.any?(lines, &(&1 =~ line)), inspect(lines)
    end

    never = fn _trial -> "it is never right" end

    assert ["seed 1, loss 0.0: it is never right"] =
             MissionCase.problems({Wrong, fault: :none}, seeds: [1], seconds: 6, always: never)

    assert MissionCase.problems({Wrong, fault: :none}, seeds: [1], seconds: 6) == []

    assert_raise ArgumentError, ~r/mission :patorl is not known/, fn ->
      MissionCase.problems(:patorl)
    end

    assert_raise ArgumentError, ~r/mission case option seconds: expected .*, got 1/, fn ->
      MissionCase.problems(:patrol, seconds: 1)
    end
  end
end
