defmodule Console.ReportTest do
  use ExUnit.Case, async: true
  alias Console.{FakeTrial, Options, Report, Runs}

  doctest Console.Cli.Format

  defp result(line) do
    {:ok, trial} = line |> Runs.options() |> Options.trial() |> FakeTrial.new()

    trial
    |> Stream.iterate(&FakeTrial.step/1)
    |> Enum.find(&FakeTrial.done?/1)
    |> FakeTrial.result()
  end

  defp keys({:object, pairs}), do: Enum.map(pairs, &elem(&1, 0))
  defp fetch({:object, pairs}, key), do: Keyword.fetch!(pairs, key)

  test "keys and their order are fixed" do
    report = Report.term(result("--kill mag2@8"), 1.5)

    assert keys(report) ==
             ~w(version seed map robots simulated_s wall_s stages leader leaders_at_once_max
                leader_changes formation claims stuck landmark_distance_m collisions min_separation_m messages fleet)a

    assert keys(fetch(report, :formation)) ==
             ~w(kind spacing_m error_mean_m error_max_m share_of_time_formed)a

    assert keys(fetch(report, :messages)) == ~w(sent lost)a

    for claim <- fetch(report, :claims),
        do: assert(keys(claim) == ~w(at_s robot worst_m worst_5s_m)a)

    for robot <- fetch(report, :fleet),
        do:
          assert(
            keys(robot) ==
              ~w(name alive state blocked_by x y theta slot error_m uncertainty_m size_ppm)a
          )

    assert Enum.map(fetch(report, :stages), &keys/1) == [
             [:stage, :at_s],
             [:stage, :at_s, :robot, :epoch, :size_ppm],
             [:stage, :at_s, :robot],
             [:stage, :at_s]
           ]
  end

  test "one seed gives the same bytes, figures have three decimals and no negative zero" do
    json = fn -> IO.iodata_to_binary(Report.json(result("--seed 5"), 0.25)) end
    assert json.() == json.()
    refute json.() =~ ~r/\.\d{4}/
    refute json.() =~ "-0.0,"
    assert json.() =~ ~s("wall_s":0.25,)
    assert String.ends_with?(json.(), "}\n")

    tiny = Report.term(%{result("") | landmark_distance_m: -0.0001}, 0.1)
    assert :erlang.float_to_binary(fetch(tiny, :landmark_distance_m), [:short]) == "0.0"
  end

  test "a run without a leader has a report and a summary too" do
    result = result("--landmark none --duration 20")
    json = IO.iodata_to_binary(Report.json(result, 0.1))
    assert json =~ ~s("leader":null)
    assert json =~ ~s("error_mean_m":null)
    assert [first | _] = Report.summary(result, false, 0.1)
    assert first =~ "No formation: 6 robots"
  end

  test "report and summary say how true each claim of formed was" do
    result = result("")
    [claim] = fetch(Report.term(result, 1.0), :claims)
    assert {fetch(claim, :worst_m), fetch(claim, :worst_5s_m)} == {0.211, 0.622}
    line = hd(Report.summary(result, true, 2.0))
    assert line =~ "Formed was wrongly claimed 1 time: a robot was 0.62 m off."
  end

  test "the summary names the robots that are blocked, and by what" do
    result = result("")
    [first | rest] = result.fleet
    blocked = %{result | fleet: [%{first | blocked_by: "the landmark"} | rest]}
    assert hd(Report.summary(blocked, false, 2.0)) =~ "Blocked: #{first.name} by the landmark."
    refute hd(Report.summary(result, false, 2.0)) =~ "Blocked"
  end

  test "the walls of a map are told of, if there are any" do
    result = result("")
    told = &hd(Report.summary(Map.put(result, :seen, &1), false, 2.0))
    seen = %{area_m2: 80.0, share: 0.5, walls: 0.25}
    assert told.(seen) =~ ~r/ Of the walls on the map 25 % are within 0.2 m of true ones\.$/
    assert told.(%{seen | walls: nil}) =~ ~r/ Seen: 40 of the 80 m² .+ \(50.0 %\)\.$/
  end

  test "the summary says who is still on the way" do
    result = result("")
    robots = Enum.map(result.fleet, &%{&1 | state: :follow, alive: &1.name != :mag1})
    line = hd(Report.summary(%{result | fleet: robots}, false, 2.0))
    assert line =~ "Still on the way: mag2, mag3, min1, min2 and 1 more."
    refute hd(Report.summary(%{result | fleet: robots}, true, 2.0)) =~ "on the way"
  end

  test "the report says how sure each robot is, the summary which are not sure enough to be in place" do
    result = result("")
    [first, second | rest] = result.fleet
    doubt = fn robot -> %{robot | state: :unsure, uncertainty_m: 0.6184} end
    one = %{result | fleet: [doubt.(first), second | rest]}
    assert hd(Report.summary(one, false, 2.0)) =~ " Not sure of its place: mag1 (±0.62 m)."

    two = %{result | fleet: [doubt.(first), doubt.(second) | rest]}

    assert hd(Report.summary(two, false, 2.0)) =~
             " Not sure of their places: mag1 (±0.62 m), mag2 (±0.62 m)."

    refute hd(Report.summary(result, false, 2.0)) =~ "sure"
    assert [robot | _] = fetch(Report.term(two, 1.0), :fleet)
    assert {fetch(robot, :state), fetch(robot, :uncertainty_m)} == {:unsure, 0.618}
    unknown = %{result | fleet: [%{first | uncertainty_m: nil} | rest]}
    assert IO.iodata_to_binary(Report.json(unknown, 1.0)) =~ ~s("uncertainty_m":null)
  end

  test "a robot's line says how sure it is of its pose" do
    scene = Runs.scene("", 12)
    [first | rest] = scene.robots
    line = fn robot -> hd(Console.Cli.Format.one(%{scene | robots: [robot | rest]}, robot.id)) end

    assert line.(%{first | leader?: false, state: :unsure, uncertainty: 0.618}) =~
             ~r/^mag1: not sure of its place, at .* degrees, ±0\.62 m by its own estimate/

    refute line.(%{first | uncertainty: nil}) =~ "±"
  end

  test "the summary counts the robots that have a place, and names the others that live" do
    %{fleet: fleet} = result = result("")
    [one, other | _] = for %{name: name} <- fleet, name != result.leader, do: name

    left = fn
      %{name: ^one} = robot -> %{robot | slot: nil, state: :idle}
      %{name: ^other} = robot -> %{robot | slot: nil, alive: false, state: :dead}
      robot -> robot
    end

    summary = hd(Report.summary(%{result | fleet: Enum.map(fleet, left)}, true, 2.0))
    assert summary =~ "In formation: column of 4 led by"
    assert summary =~ "Not in it: #{one} (idle)."
  end

  test "the summary says whether there is a formation" do
    result = result("")
    assert hd(Report.summary(result, true, 2.0)) =~ "In formation: column of 6 led by"
    refute hd(Report.summary(result, true, 2.0)) =~ "Not in it"
    assert hd(Report.summary(result, false, 2.0)) =~ "Not in formation"
    refute hd(Report.summary(%{result | claims: []}, true, 2.0)) =~ "wrongly"

    assert List.last(Report.summary(%{result | simulated_s: 60.0}, true, 2.0)) =~
             "30 times real time"
  end
end
