defmodule Vision.Marks.ScheduleTest do
  use ExUnit.Case, async: true
  alias Vision.Mark
  alias Vision.Marks.Schedule
  doctest Vision.Marks.Schedule
  doctest Vision.Mark

  @size {640, 480}

  defp mark(x, y, half \\ 10) do
    corners = [
      {x - half, y - half},
      {x + half, y - half},
      {x + half, y + half},
      {x - half, y + half}
    ]

    place = %{x: x, y: y, corners: corners, width: 640, height: 480}
    struct!(Mark, Map.merge(place, %{family: :tag36h11, id: 1, at_ms: 0}))
  end

  defp plans(period_ms, marks) do
    {plans, _schedule} =
      Enum.map_reduce(0..(3_000 - period_ms)//period_ms, %Schedule{}, fn at_ms, schedule ->
        case Schedule.plan(schedule, at_ms, @size) do
          :rest -> {:rest, schedule}
          {part, _boxes} -> {part, Schedule.note(schedule, part, at_ms, marks)}
        end
      end)

    Enum.frequencies(plans)
  end

  test "whole pictures twice a second, boxes ten times, whatever the camera's rate" do
    marks = [mark(100.0, 100.0)]
    assert plans(100, marks) == %{whole: 6, boxes: 24}
    assert plans(33, marks) == %{whole: 6, boxes: 24, rest: 60}
    assert plans(250, marks) == %{whole: 6, boxes: 6}
  end

  test "boxes are twice as wide as a mark, at least 80 pixels, and within the picture" do
    at = fn marks -> Schedule.plan(Schedule.note(%Schedule{}, :whole, 0, marks), 100, @size) end
    assert at.([mark(300.0, 200.0, 30)]) == {:boxes, [{240, 140, 360, 260}]}
    assert at.([mark(10.0, 470.0, 5)]) == {:boxes, [{0, 430, 50, 480}]}
    assert at.([]) == {:boxes, []}
    # The barcode stands to the right of the square.
    similar = %{mark(300.0, 200.0, 30) | family: :similar}
    assert at.([similar]) == {:boxes, [{240, 140, 420, 260}]}
  end

  test "boxes that overlap become one, and as much as a whole picture is one" do
    at = fn marks -> Schedule.plan(Schedule.note(%Schedule{}, :whole, 0, marks), 100, @size) end

    assert at.([mark(300.0, 200.0), mark(500.0, 200.0), mark(350.0, 220.0)]) ==
             {:boxes, [{260, 160, 390, 260}, {460, 160, 540, 240}]}

    # Two that only a third one joins.
    assert at.([mark(100.0, 100.0), mark(240.0, 100.0), mark(170.0, 100.0)]) ==
             {:boxes, [{60, 60, 280, 140}]}

    assert at.([mark(320.0, 240.0, 200)]) == {:whole, [{0, 0, 640, 480}]}
  end

  test "a clock that was set back makes nobody blind" do
    schedule = Schedule.note(%Schedule{}, :whole, 1_000_000, [])
    assert {:whole, _} = Schedule.plan(schedule, 5, @size)
  end
end
