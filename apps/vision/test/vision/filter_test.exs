defmodule Vision.FilterTest do
  use ExUnit.Case, async: true
  doctest Vision.Filter
  alias Vision.{Blob, Filter}

  @blob %Blob{
    colour: "Yellow",
    area: 100,
    share: 100 / 76_800,
    x: 5.0,
    y: 5.0,
    left: 0,
    top: 0,
    right: 9,
    bottom: 9,
    width: 320,
    height: 240
  }

  test "by colour, area and share" do
    red = %{@blob | colour: "Red"}
    small = %{@blob | area: 19, share: 19 / 76_800}
    assert Filter.colour([@blob, red], "Red") == [red]
    assert Filter.least_area([@blob, small], 20) == [@blob]
    assert Filter.least_share([@blob, small], 0.001) == [@blob]
  end

  test "the largest is by share, since frames differ in size" do
    large_frame = %{@blob | area: 200, width: 640, height: 480, share: 200 / 307_200}
    assert Filter.largest([large_frame, @blob]) == @blob
  end

  test "nothing about a frame without size is real" do
    assert Filter.real([%{@blob | width: 0}, %{@blob | left: 12}], {320, 240}) == []
  end
end
