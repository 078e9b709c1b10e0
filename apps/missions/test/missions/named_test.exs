defmodule Missions.NamedTest do
  # The missions that the configuration names are those of the whole build.
  use ExUnit.Case, async: false
  alias Swarm.MissionRegistry
  alias Swarm.MissionRegistry.Text
  doctest MissionRegistry

  defmodule Tabled do
    @moduledoc "A mission that has a table of options, and nothing that checks them."
    @behaviour Robot.Mission

    @impl Robot.Mission
    def option_table do
      [
        loop: [{:one_of, [:square, :cross]}, default: :square],
        period: [{:number, 10, 600, "s"}, default: 60.0],
        points: {:list, {:tuple, [{:number, -9, 9}, {:number, -9, 9}], "{x, y}"}, 8},
        say: {:text, "a word"},
        back: :boolean
      ]
    end

    @impl Robot.Mission
    def init(_robot, options), do: {:ready, options, []}

    @impl Robot.Mission
    def handle(_event, options), do: {:ready, options, []}
  end

  setup do
    before = Application.get_env(:swarm, :missions)
    Application.put_env(:swarm, :missions, landmark: Elixir.Missions.Landmark, tabled: Tabled)
    on_exit(fn -> Application.put_env(:swarm, :missions, before) end)
  end

  test "a name, as an atom or as text, and a module reach a mission" do
    for name <- [:tabled, "tabled", Tabled, {:tabled, []}, {Tabled, []}],
        do:
          assert(
            {:ok, {Tabled, [loop: :square, period: 60.0]}} == MissionRegistry.choose(name, 4)
          )

    assert MissionRegistry.name(Tabled) == "tabled"
    assert MissionRegistry.name(Robot.Mission.Manual) == "Robot.Mission.Manual"
  end

  test "what is no mission is refused in one line, with what may have been meant" do
    for {name, line} <- [
          {:tabeld,
           "mission :tabeld is not known; expected one of :landmark, :tabled; did you mean :tabled?"},
          {"tabeld",
           ~s(mission "tabeld" is not known; expected one of landmark, tabled; did you mean tabled?)},
          {Enum, "mission Enum is not known; expected one of :landmark, :tabled"},
          {nil, "mission nil is not known; expected one of :landmark, :tabled"},
          {{:tabled, [period: 5]},
           "tabled option period: expected a number from 10 to 600 s, got 5"},
          {{:tabled, 5}, "mission :tabled options: expected [key: value, …], got 5"},
          {7, "mission: expected a name, or {name, [key: value, …]}, got 7"}
        ],
        do: assert(MissionRegistry.choose(name, 4) == {:error, line})
  end

  test "options as text are read by the mission's table" do
    for {text, options} <- [
          {"tabled", []},
          {"tabled:loop=cross,period=90", [loop: :cross, period: 90.0]},
          {"tabled: back = on , say=hello", [back: true, say: "hello"]},
          {"tabled:back=off,say=5", [back: false, say: "5"]},
          {"tabled:say=a nice loop=", [say: "a nice loop="]},
          {"tabled:points=[{1,2},{3.5,-4}],loop=square", [points: [{1.0, 2.0}, {3.5, -4.0}]]}
        ] do
      assert {:ok, {Tabled, read}} = Text.read(text, 4)
      assert Enum.all?(options, &(&1 in read)), inspect(read)
    end

    assert Text.read("landmark:formation=wedge:1.2,assign=cost", 4) ==
             {:ok, {Elixir.Missions.Landmark, formation: {:wedge, 1.2}, assign: :cost}}
  end

  test "wrong options as text are named in one line" do
    for {text, line} <- [
          {"tabled:loop=sqare",
           "tabled option loop: expected :square or :cross, got \"sqare\"; did you mean :square?"},
          {"tabled:lop=square",
           "tabled option lop is not known: allowed are loop, period, points, say, back; did you mean loop?"},
          {"tabled:period=90,period=80", "tabled option period is given twice"},
          {"tabled:points=[{1,2}]:period=90",
           ~s(tabled: options are separated by a comma, not by ":": …,period=…)},
          {"tabled:period=90 loop=cross",
           ~s(tabled: options are separated by a comma, not by " ": …,loop=…)},
          {"tabled:period=90;loop=cross",
           ~s(tabled: options are separated by a comma, not by ";": …,loop=…)},
          {"tabled:period", ~s(tabled: expected KEY=VALUE,…, got "period")},
          {"tabled:period=halt()",
           "tabled option period: expected a number from 10 to 600 s, got \"halt()\""}
        ],
        do: assert(Text.read(text, 4) == {:error, line})
  end

  test "no text becomes an atom, whatever it says" do
    junk = fn -> "a#{:rand.uniform(1_000_000_000)}x" end

    texts = fn ->
      [
        "#{junk.()}:#{junk.()}=1",
        "tabled:#{junk.()}=:#{junk.()}",
        "tabled:loop=#{junk.()}",
        "tabled:points=[{:#{junk.()}, #{junk.()}}]"
      ]
    end

    # The first time loads the modules that say what is wrong.
    refuse = fn text ->
      assert {:error, line} = Text.read(text, nil)
      refute line =~ "\n"
    end

    Enum.each(texts.(), refuse)

    messages = fn ->
      ["#{junk.()}:leg=2", "leg:#{junk.()}=2", "leg:leg=:#{junk.()}", "leg:leg=#{junk.()}"]
    end

    unsaid = fn text ->
      assert {:error, _line} = Text.message({:ok, %{state: {Missions.Flock, :flock}}, 0}, text)
    end

    Enum.each(messages.(), unsaid)
    before = :erlang.system_info(:atom_count)
    for _ <- 1..50, do: Enum.each(texts.(), refuse)
    for _ <- 1..50, do: Enum.each(messages.(), unsaid)
    assert :erlang.system_info(:atom_count) == before
  end
end
