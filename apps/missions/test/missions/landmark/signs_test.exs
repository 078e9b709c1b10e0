defmodule Missions.Landmark.SignsTest do
  @moduledoc "Marks that choose the formation."
  use ExUnit.Case, async: true
  alias Missions.Landmark
  alias Missions.Landmark.Signs
  alias Vision.{Detections, Mark}

  @formations [{3, {:line, 1.0}}, {4, {:circle, 1.5}}]

  defp leader(options \\ []) do
    {:ok, options} = Landmark.Options.check([formations: @formations] ++ options, nil)
    {_phase, mission, []} = Landmark.init(:mag1, options)
    %{mission | phase: :lead}
  end

  # The mission after frames, each of which is a list of `{id, range}`, and the stages that it told.
  defp see(mission, frames) do
    start_ms = (mission.signs.at_ms || 0) + 100

    Enum.map_reduce(Enum.with_index(frames), mission, fn {marks, n}, mission ->
      at_ms = start_ms + 100 * n

      marks =
        for {id, range} <- marks,
            do: %Mark{
              family: :tag36h11,
              id: id,
              at_ms: at_ms,
              x: 9.0,
              y: 9.0,
              corners: [],
              width: 320,
              height: 240,
              range: range
            }

      detections = %Detections{at_ms: at_ms, blobs: [], marks: marks}
      percept = %Robot.Percept{robot: :mag1, at_ms: at_ms, profile: Hal.Profile.magellan()}
      {mission, stages} = Signs.read(%{mission | percept: %{percept | detections: detections}})
      {stages, mission}
    end)
    |> then(fn {stages, mission} -> {mission, List.flatten(stages)} end)
  end

  test "a leader takes the formation of a mark after three frames, and says so once" do
    {mission, stages} = see(leader(), [[{3, 2.0}], [{3, 2.0}]])
    assert {mission.formation, mission.asked_no, stages} == {{:column, 1.0}, 0, []}

    {mission, stages} = see(mission, [[{3, 2.0}], [{3, 2.0}], [{3, 2.0}]])
    assert {mission.formation, mission.asked_no} == {{:line, 1.0}, 1}
    assert [{:stage, :sign, %{mark: 3, says: says}}] = stages
    assert says == "sees mark 3, and asks for line 1.0"
  end

  test "a frame without it, and one that shows it twice, begin anew" do
    for gap <- [[], [{3, 2.0}, {3, 3.0}]] do
      {mission, _stages} = see(leader(), [[{3, 2.0}], [{3, 2.0}], gap, [{3, 2.0}], [{3, 2.0}]])
      assert mission.formation == {:column, 1.0}
    end
  end

  test "the nearest counts, and one without a formation does not" do
    both = List.duplicate([{3, 2.0}, {4, 1.5}, {9, 0.5}], 3)
    {mission, _stages} = see(leader(), both)
    assert mission.formation == {:circle, 1.5}
  end

  test "what a person asks for meanwhile stays until another mark is seen" do
    {mission, _stages} = see(leader(), List.duplicate([{3, 2.0}], 3))
    {:lead, mission, []} = Landmark.handle({:command, {:formation, :wedge, 1.0}}, mission)
    {mission, []} = see(mission, List.duplicate([{3, 2.0}], 5))
    assert mission.formation == {:wedge, 1.0}

    {mission, [_stage]} = see(mission, List.duplicate([{4, 2.0}], 3))
    assert mission.formation == {:circle, 1.5}
    {mission, [_stage]} = see(mission, List.duplicate([{3, 2.0}], 3))
    assert mission.formation == {:line, 1.0}
  end

  test "a follower takes none by itself, but reads on" do
    {mission, []} = see(%{leader() | phase: :follow}, List.duplicate([{3, 2.0}], 5))
    assert mission.formation == {:column, 1.0}
    {mission, [_stage]} = see(%{mission | phase: :lead}, [[{3, 2.0}]])
    assert mission.formation == {:line, 1.0}
  end

  test "wrong ones are refused in a line" do
    assert {:error, line} = Landmark.Options.check([formations: [{3, :heap}]], nil)
    assert line =~ "landmark option formations"
  end
end
