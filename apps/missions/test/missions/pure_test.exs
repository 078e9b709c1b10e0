defmodule Missions.PureTest do
  use ExUnit.Case, async: true
  alias Missions.Landmark
  alias Missions.Landmark.Reference
  doctest Missions
  doctest Landmark.Claim
  doctest Landmark.Company
  doctest Landmark.Options
  doctest Landmark.Reference
  doctest Landmark.Policy
  doctest Landmark.Transitions

  @anchor %Reference{
    leader: :mag1,
    epoch: 1,
    sequence: 1,
    pose: {0, 0, 0},
    twist: {0, 0},
    formation: {:column, 1.0},
    order: [:mag2],
    size: 2,
    places: [1]
  }

  test "an anchor of an impossible epoch is not accepted as a leader's" do
    {_phase, mission, []} = Landmark.init(:mag2, [])
    far = Landmark.Beat.pass_on(:mag3, %{@anchor | epoch: 999_999_999})
    {_phase, same, _effects} = Landmark.handle({:message, far}, mission)
    assert same.anchor == nil
    near = Landmark.Beat.pass_on(:mag3, @anchor)
    {_phase, led, _effects} = Landmark.handle({:message, near}, mission)
    assert led.anchor == @anchor
  end

  test "options that were already checked pass unchanged" do
    given = [formation: {:wedge, 1.5}, assign: :cost, policy: :majority, of: 3, lost_link: :hold]
    assert {:ok, checked} = Landmark.Options.check(given, nil)
    assert Enum.sort(checked) == Enum.sort(given)
    assert Landmark.Options.check(checked, nil) == {:ok, checked}
  end

  test "a majority of an unknown number is refused" do
    assert {:error, line} = Landmark.Options.check([policy: :majority], nil)
    assert line =~ "option of is missing"
    assert {:ok, options} = Landmark.Options.check([policy: :majority], 5)
    assert options[:of] == 5
  end

  test "each wrong option is named with what is allowed" do
    for {options, words} <- [
          {[formation: :star], ~w(star wedge)},
          {[formation: {:wedge, 99}], ~w(99)},
          {[assign: 3], ~w(assign 3 :chain)},
          {[leader_change: :perhaps], ~w(leader_change perhaps true)},
          {[colour: :red], ~w(colour :red name)},
          {[policy: :all], ~w(policy :all :majority)},
          {[lost_link: 1], ~w(lost_link 1 :hold)},
          {[sped: 1], ~w(sped formation)}
        ] do
      assert {:error, line} = Landmark.Options.check(options, 3)
      for word <- words, do: assert(line =~ word, "#{line} lacks #{word}")
    end
  end
end
