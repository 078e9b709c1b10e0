defmodule Record.Replay.MemberTest do
  use ExUnit.Case, async: true
  alias Hal.{Odometry, Pose, Profile, Twist}
  alias Record.Replay
  alias Swarm.Member
  doctest Record.Replay.Member

  defmodule Errand do
    @moduledoc "Goes when it is told."
    @behaviour Robot.Mission

    @impl Robot.Mission
    def init(_robot, _options), do: {:waits, nil, []}

    @impl Robot.Mission
    def handle({:command, :start}, nil),
      do: {:goes, nil, [{:goal, :errand, {Robot.Behaviour.Goto, x: 2.0, y: 0.0}}]}

    def handle(_event, nil), do: {:goes, nil, []}

    @impl Robot.Mission
    def explain(nil), do: [{"errand", "to run"}]
  end

  defp member do
    Member.new(
      id: :replay_one,
      profile: Profile.magellan(),
      start: Pose.new(0, 0),
      mission: {Errand, []}
    )
  end

  defp inputs do
    still = %Odometry{pose: Pose.new(0, 0), twist: Twist.zero()}

    [{:command, :start, 0}] ++
      for at_ms <- 0..900//100,
          input <- [{:reading, {:odometry, still}, at_ms}, {:tick, at_ms}, {:reflex, at_ms}],
          do: input
  end

  defp record(inputs) do
    {steps, _member} =
      Enum.map_reduce(inputs, member(), fn input, member ->
        {member, effects} = Member.step(member, input)
        # A recording holds no answers to people.
        {{input, effects -- [{:reply, :ok}]}, member}
      end)

    steps
  end

  defp replay(steps) do
    {differences, _member} =
      Enum.flat_map_reduce(steps, member(), fn {input, effects}, member ->
        {member, difference} = Replay.Member.step(member, input, effects)
        {List.wrap(difference), member}
      end)

    differences
  end

  test "the same inputs have the same effects, and the robot has driven" do
    steps = record(inputs())
    assert replay(steps) == []
    assert Enum.any?(steps, &match?({{:reflex, _at_ms}, [{:drive, %{linear: v}}]} when v > 0, &1))
  end

  test "an effect that is another is told with both, and with the input" do
    steps = record(inputs())
    {{:reflex, 500} = input, [{:drive, twist}]} = List.keyfind(steps, {:reflex, 500}, 0)
    faster = {:drive, %{twist | linear: twist.linear + 0.01}}
    changed = List.keyreplace(steps, input, 0, {input, [faster]})

    assert replay(changed) == [
             %{
               robot: :replay_one,
               at_ms: 500,
               input: input,
               recorded: [faster],
               replayed: [{:drive, twist}]
             }
           ]
  end

  test "an input that is missing shows in what the robot does afterwards" do
    steps = record(inputs())
    without = List.keydelete(steps, {:command, :start, 0}, 0)
    assert [%{at_ms: 0, replayed: [{:drive, %{linear: linear}}]} | _] = replay(without)
    assert linear == 0.0
  end

  test "the reasons name the chosen wish, what lost, and the limits of the gate" do
    {before, [tick | rest]} = Enum.split_while(inputs(), &(&1 != {:tick, 500}))
    member = Enum.reduce(before, member(), fn input, m -> elem(Member.step(m, input), 0) end)
    reasons = Replay.Member.reasons(member, [tick, hd(rest)])

    assert [{%{by: :goto}, weight}, {%{by: :rest}, less}] = reasons.wishes
    assert weight > less
    assert reasons.driving.limits != []
    assert %Pose{} = reasons.percept.pose
    assert reasons.mission == [{"errand", "to run"}]
    assert {:drive, reasons.driving.twist} in reasons.effects
  end
end
