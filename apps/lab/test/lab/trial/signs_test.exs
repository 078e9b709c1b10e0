defmodule Lab.Trial.SignsTest do
  @moduledoc "A mark that the leader of a run sees chooses the formation."
  use ExUnit.Case, async: true
  alias Lab.{Run, Trial}
  alias Vision.Marks

  @why_not (case Marks.available() do
              :ok -> nil
              {:error, line} -> line
            end)

  # Marks round the landmark, one to each side.
  @landmark {2.0, 0.0}
  @marks [
    {3, {2.35, 0.0, 0}},
    {4, {2.0, 0.35, 90}},
    {5, {1.65, 0.0, 180}},
    {6, {2.0, -0.35, -90}}
  ]

  defp run(formations) do
    {:ok, trial} =
      Trial.new(
        robots: [:mag1, :mag2, :min1],
        seed: 2,
        landmark: @landmark,
        marks: [size: 0.3, at: @marks],
        mission: {:landmark, formation: :column, formations: formations},
        blobs: :direct,
        duration_s: 120
      )

    Trial.result(Run.play(trial, &Trial.done?/1))
  end

  @tag skip: @why_not
  test "all stand in it, and people are told why" do
    result = run(for {id, _at} <- @marks, do: {id, :line})
    assert [%{says: says} | _] = for(%{stage: :sign} = stage <- result.stages, do: stage)
    assert says =~ ~r/^sees mark [3-6], and asks for line 1.0$/
    assert Enum.any?(result.stages, &(&1.stage == :formed))
    assert result.formation.kind == :line
  end

  @tag skip: @why_not
  test "marks without a formation choose none" do
    result = run([{9, :line}])
    assert for(%{stage: :sign} = stage <- result.stages, do: stage) == []
    assert Enum.any?(result.stages, &(&1.stage == :formed))
  end
end
