defmodule Lab.Scenario.NeverTest do
  @moduledoc """
  Each invariant is an expectation of a scenario's file, and gives there the verdict of `mix chaos`: of a run that breaks
  it, and of one that does not.
  """
  use Lab.LockstepCase, async: true
  alias Missions.Landmark.Reference
  alias Lab.Chaos.{Runner, ScenarioFile}
  alias Lab.Check.{Invariants, Violation}
  alias Lab.{Scenario, Trial}

  @robots [:mag1, :mag2, :mag3]

  defmodule Liar do
    @moduledoc "A mission that lets its robot stand, and is wrong in the way that its option names."
    @behaviour Robot.Mission

    @impl Robot.Mission
    def option_table, do: [fault: {:one_of, [:none | Lab.Check.Invariants.names()]}]

    @impl Robot.Mission
    def roles, do: %{lead: :leads, follow: :follows}

    @impl Robot.Mission
    defdelegate account(claim), to: Missions.Landmark

    @impl Robot.Mission
    defdelegate shape(claim, pose, ahead_m), to: Missions.Landmark

    @impl Robot.Mission
    defdelegate place(mission, at_ms), to: Missions.Landmark

    @impl Robot.Mission
    def init(robot, options), do: {:idle, %{me: robot, fault: options[:fault]}, []}

    @impl Robot.Mission
    def handle({:tick, %{at_ms: at_ms}}, %{me: me, fault: fault}) do
      {phase, more} = act(fault, me, at_ms)

      claim = %{
        phase: phase,
        leader: :mag1,
        epoch: 1,
        sight: nil,
        in_place: true,
        anchor: anchor()
      }

      mission = %{me: me, fault: fault, phase: phase, anchor: anchor(), anchor_ms: at_ms}
      claim = if phase == :lead, do: claim, else: Map.delete(claim, :anchor)

      {phase, Map.merge(mission, more[:mission] || %{}),
       [{:claim, Map.merge(claim, more[:claim] || %{})}]}
    end

    def handle(_event, mission), do: {:agree, mission, []}

    defp act(:two_leaders, :mag2, _at_ms), do: {:lead, claim: %{leader: :mag2, epoch: 2}}
    defp act(:two_majorities, :mag2, _at_ms), do: {:lead, claim: %{leader: :mag2, epoch: 2}}
    defp act(:same_epoch, _me, at_ms) when at_ms < 3_000, do: {:agree, []}
    defp act(:same_epoch, :mag2, _at_ms), do: {:lead, claim: %{leader: :mag2}}
    defp act(:not_together, :mag3, _at_ms), do: {:follow, claim: %{leader: :mag2}}
    defp act(:no_leader, _me, _at_ms), do: {:agree, claim: %{leader: nil, sight: %{size_ppm: 9}}}
    defp act(:same_slot, :mag3, _at_ms), do: {:follow, mission: %{anchor: anchor([:mag3, :mag2])}}
    defp act(:bad_anchor, :mag1, _at_ms), do: {:lead, mission: %{anchor: anchor([:mag2, :mag2])}}
    defp act(:false_claim, :mag1, at_ms), do: {:lead, claim: %{formed: at_ms >= 1_000}}
    defp act(:stuck, :mag2, _at_ms), do: {:follow, claim: %{in_place: false}}
    defp act(:crash, :mag3, at_ms) when at_ms >= 1_000, do: raise("out of order")
    defp act(_fault, :mag1, _at_ms), do: {:lead, []}
    defp act(_fault, _me, _at_ms), do: {:follow, []}

    defp anchor(order \\ [:mag2, :mag3]) do
      %Reference{
        leader: :mag1,
        epoch: 1,
        sequence: 1,
        pose: {0, 0, 0},
        twist: {0, 0},
        formation: {:column, 1.0},
        order: order,
        size: 3,
        places: [1, 2]
      }
    end
  end

  # How long a run of the liar takes until its fault is seen.
  @lies [
    two_leaders: 5,
    same_epoch: 5,
    two_majorities: 1,
    not_together: 11,
    no_leader: 46,
    same_slot: 2,
    bad_anchor: 1,
    stuck: 22,
    false_claim: 3,
    crash: 2
  ]

  defp options(more), do: [robots: @robots, blobs: :direct, plan: :none] ++ more

  defp lying(invariant, fault) do
    policy = if invariant == :two_majorities, do: :majority, else: :available
    mission = {Liar, fault: fault}
    {options(policy: policy, duration_s: @lies[invariant], mission: mission), []}
  end

  # The options and the script of a run that breaks an invariant, and of one beside it that does not.
  defp runs(invariant) when is_map_key(%{collision: 0}, invariant) do
    drive = [{0, {:displace, :mag1, {-3, 0, 0}}}, {0, {:tell, :mag1, "move:0.5:0"}}]
    # It cannot brake so soon.
    in_the_way = [{4, {:displace, :mag2, {-0.8, 0, 0}}}]
    alone = options(landmark: :none, duration_s: 6) |> Keyword.replace(:robots, [:mag1, :mag2])
    {{alone, drive ++ in_the_way}, {alone, drive}}
  end

  defp runs(invariant) when invariant in [:too_fast, :too_abrupt] do
    drive = [{0, {:displace, :mag1, {-3, 0, 0}}}, {0, {:tell, :mag1, "move:0.3:0"}}]
    run = {options(landmark: :none, duration_s: 3), drive}
    {run, run}
  end

  defp runs(invariant) when invariant in [:stop_ignored, :stop_lost] do
    run = {options(duration_s: 5), [{1, {:estop, :mag2}}]}
    {run, run}
  end

  defp runs(invariant), do: {lying(invariant, invariant), lying(invariant, :none)}

  # What no mission and no script can bring about is wrong from the beginning: a body that obeys other limits than its gate,
  # a stop of which the gate has not heard, a radio that loses all though nobody knows.
  defp spoil(trial, :too_fast), do: profile(trial, max_linear: 0.2)
  defp spoil(trial, :too_abrupt), do: profile(trial, max_acceleration: 0.1)
  defp spoil(trial, :stop_lost), do: %{trial | radio: Sim.Radio.lose(trial.radio, 1.0)}

  defp spoil(trial, :stop_ignored),
    do:
      put_in(trial.members[:mag1].lockstep.roles.estop.stop, %Swarm.EStop.State{
        held: [{:mag1, 0, 1}]
      })

  defp spoil(trial, _by_its_options), do: trial

  defp profile(trial, limits) do
    robots = Map.update!(trial.world.robots, :mag1, &%{&1 | profile: struct!(&1.profile, limits)})
    %{trial | world: %{trial.world | robots: robots}}
  end

  # As `mix chaos` judges it: the line of the first violation of this invariant.
  defp by_chaos(trial, invariant) do
    with %Violation{} = violation <- Runner.first_of(trial, invariant),
         do: Violation.line(violation)
  end

  # As `mix scenario` judges its file.
  defp by_scenario({options, script}, invariant, spoil) do
    {:ok, scenario} =
      Scenario.new(options: options, script: script, expect: [{:never, invariant}])

    assert {:ok, read} = scenario |> Scenario.File.text() |> Scenario.File.parse()
    assert read == scenario
    {:ok, trial} = Trial.new(Scenario.trial(read))
    {run, nil} = Scenario.Runner.play(read, Scenario.Runner.begin(read, spoil.(trial)))
    {_result, [verdict]} = Scenario.Runner.verdicts(run)
    if verdict.held?, do: nil, else: verdict.figures
  end

  for invariant <- Invariants.names() do
    test "never #{invariant}: a scenario fails with the words of chaos, and holds beside it" do
      invariant = unquote(invariant)
      {{options, script} = wrong, right} = runs(invariant)
      {:ok, trial} = Trial.new(Map.new([{:script, script} | options]))
      line = trial |> spoil(invariant) |> by_chaos(invariant)
      assert line =~ ~r/^#{invariant} at \d+\.\d s, /
      assert by_scenario(wrong, invariant, &spoil(&1, invariant)) == line

      {options, script} = right
      {:ok, trial} = Trial.new(Map.new([{:script, script} | options]))
      assert by_chaos(trial, invariant) == nil
      assert by_scenario(right, invariant, & &1) == nil
    end
  end

  test "a run that chaos finds wrong is saved, and its file fails with the same line" do
    {options, _no_script} = lying(:not_together, :not_together)
    draw = fn _seed, _number -> options end
    assert %{runs: [%{failures: [failure | _]}]} = Runner.run(1, [1], draw: draw, attempts: 6)
    assert {:ok, "chaos-1-1-not_together.exs", text} = ScenarioFile.text(1, failure)
    assert {:ok, scenario} = Scenario.File.parse(text)
    assert {:ok, _result, [verdict]} = Scenario.Runner.run(scenario)
    refute verdict.held?
    assert verdict.figures == Violation.line(failure.again)
    assert scenario.about =~ verdict.figures
  end

  test "a run that raises does so in a scenario, too, unless it expects that it does not" do
    {options, _no_script} = lying(:crash, :crash)
    {:ok, scenario} = Scenario.new(options: options, expect: [{:never, :collision}])
    assert_raise RuntimeError, "out of order", fn -> Scenario.Runner.run(scenario) end
    {:ok, both} = Scenario.new(options: options, expect: [{:never, :collision}, {:never, :crash}])
    assert {:ok, %{simulated_s: 1.0}, [calm, crash]} = Scenario.Runner.run(both)
    assert calm.held? and not crash.held? and crash.at_s == 1.0
    assert crash.figures =~ ~r/^crash at 1\.0 s, the run: %RuntimeError\{.*"out of order"/
  end

  test "a robot that was lifted did not drive there" do
    script = [{1, {:displace, :mag1, {-3, 0, 0}}}, {1.5, {:displace, :mag1, {3, 2, 0}}}]
    right = {options(landmark: :none, duration_s: 3), [{1, {:estop, :mag1}} | script]}

    for invariant <- [:too_fast, :stop_ignored],
        do: assert(by_scenario(right, invariant, & &1) == nil)
  end
end
