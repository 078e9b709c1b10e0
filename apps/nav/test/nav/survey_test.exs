defmodule Nav.SurveyTest do
  use ExUnit.Case, async: true
  alias Hal.{Odometry, Pose, Profile, Twist}
  alias Nav.Survey
  doctest Nav.Survey

  # A Magellan at this pose; sonar 11 looks ahead.
  defp percept(at_ms, pose, ahead, options \\ []) do
    sonar = List.replace_at(List.duplicate(5.1, 16), 11, ahead)
    odometry = %Odometry{pose: pose, twist: Twist.zero(), frame: nil}

    percept = %{
      at_ms: at_ms,
      profile: Profile.magellan(),
      pose: pose,
      uncertainty: nil,
      peers: %{}
    }

    Map.merge(percept, Map.new([odometry: odometry, sonar: sonar] ++ options))
  end

  defp look(survey, percepts) do
    Enum.reduce(percepts, survey, fn percept, survey ->
      {survey, _changed} = Survey.update(survey, percept)
      survey
    end)
  end

  defp state(survey, {x, y}) do
    tile = Survey.tile()
    {i, j} = {floor(x / Survey.cell()), floor(y / Survey.cell())}
    states = Survey.states(survey, Survey.tile_of({x, y}))
    :binary.at(states, Integer.mod(j, tile) * tile + Integer.mod(i, tile))
  end

  test "three echoes are a wall, what lies before it is free, and what nobody has looked at is unknown" do
    # From 3 m left of the origin, so that tiles with negative numbers are looked at, too.
    percepts = for k <- 0..3, do: percept(k * 1_000, Pose.new(-3.0, 0.02), 1.2)
    survey = look(Survey.new(), percepts)
    assert state(survey, {-1.57, 0.02}) == 2
    assert state(survey, {-2.2, 0.02}) == 1
    assert state(survey, {-1.2, 0.02}) == 0
    assert state(survey, {-3.0, 0.02}) == 1
    # One look is not enough, and a far echo is no wall.
    assert state(look(Survey.new(), [hd(percepts)]), {-2.2, 0.02}) == 0
    far = for k <- 0..3, do: percept(k * 1_000, Pose.new(-3.0, 0.02), 1.8)
    assert state(look(Survey.new(), far), {-0.97, 0.02}) == 0
  end

  test "what it saw stays, however long ago and far away that was" do
    here = for k <- 0..3, do: percept(k * 1_000, Pose.new(0.0, 0.0), 1.2)
    there = for k <- 0..9, do: percept(9_000_000 + k * 1_000, Pose.new(40.0, 0.0), 5.1)
    survey = Survey.new() |> look(here) |> look(there)
    assert state(survey, {1.43, 0.02}) == 2
    assert state(survey, {40.5, 0.02}) == 1
  end

  test "another robot is no wall, even where it is not quite where it tells" do
    peer = %{pose: Pose.new(1.9, 0.0), twist: Twist.zero(), radius: 0.2, at_ms: 0, mode: :moving}
    uncertainty = %{radius: 0.3, lost?: false}

    looks = fn options ->
      for k <- 0..3, do: percept(k * 1_000, Pose.new(0.0, 0.0), 1.2, options)
    end

    told = [peers: %{mag2: peer}]
    assert state(look(Survey.new(), looks.(told)), {1.43, 0.02}) == 2
    unsure = look(Survey.new(), looks.([uncertainty: uncertainty] ++ told))
    assert state(unsure, {1.43, 0.02}) != 2
  end

  test "it takes nothing from a robot that does not know where it is, or has no sonars" do
    good = percept(0, Pose.new(0.0, 0.0), 1.2)

    for bad <- [
          %{good | pose: nil},
          %{good | odometry: nil},
          %{good | sonar: nil},
          %{good | uncertainty: %{radius: 9.0, lost?: true}}
        ],
        do: assert(Survey.update(Survey.new(), bad) == {Survey.new(), []})

    {survey, [_ | _] = changed} = Survey.update(Survey.new(), good)
    assert Enum.sort(changed) == survey.tiles |> Map.keys() |> Enum.sort()
  end
end
