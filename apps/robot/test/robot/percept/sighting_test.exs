defmodule Robot.Percept.SightingTest do
  @moduledoc "What a picture shows of a colour, and how far away that is, is one answer for all that ask."
  use ExUnit.Case, async: true
  doctest Robot.Percept.Ground
  alias Hal.Profile
  alias Robot.Percept
  alias Robot.Percept.Sighting
  alias Vision.{Blob, Detections}

  @blob %Blob{
    colour: "Y",
    area: 768,
    share: 0.01,
    x: 159.5,
    y: 119.5,
    left: 140,
    right: 179,
    top: 100,
    bottom: 139,
    width: 320,
    height: 240,
    distance: 2.0
  }

  defp percept(blobs) do
    picture = %Detections{at_ms: 0, blobs: blobs, pan: 0.25, field_of_view: 1.0}
    %Percept{robot: :mag1, at_ms: 0, profile: Profile.magellan(), detections: picture}
  end

  defp box(blob, left, top), do: %{blob | left: left, top: top, right: left + 5, bottom: top + 5}

  test "the largest of a colour counts, of equals the topmost, then the leftmost" do
    one = box(@blob, 9, 4)
    small = %{box(@blob, 0, 0) | area: 700, share: 0.009}
    red = %{box(@blob, 0, 200) | colour: "R", area: 9_000, share: 0.2}

    for blobs <- [
          [one],
          [small, one],
          [box(@blob, 10, 4), one, red],
          [red, one, box(@blob, 0, 5)]
        ],
        percept = percept(blobs),
        percept <- [percept, Sighting.note(percept)] do
      assert %{blob: ^one, bearing: 0.25} = Sighting.largest(percept, "Y")
      assert Sighting.largest(percept, nil).blob == if(red in blobs, do: red, else: one)
      assert Sighting.largest(percept, "Y", 0.011) == nil
      assert Sighting.largest(percept, "Z") == nil
    end
  end

  test "without a fresh picture nothing is seen, whatever an earlier one showed" do
    blind = %{Sighting.note(percept([@blob])) | detections: nil}
    assert Sighting.largest(blind, "Y") == nil
    assert Sighting.note(blind).objects == %{}
    assert Sighting.of(blind, "Y") == nil
  end

  test "one distance is there, one is right or not told, and one is by the width where only that is right" do
    cut = %{@blob | clipped?: true, top: 0}
    aside = %{cut | left: 0}
    red = %{@blob | colour: "R", top: 141, bottom: 180}
    near = %{cut | share: 0.25}
    by_width = Sighting.distance_by_width(cut, 0.15, 1.0)
    refute by_width == 2.0

    for {blob, others, rough, measured, by_width} <- [
          {@blob, [], 2.0, 2.0, 2.0},
          {@blob, [red], 2.0, nil, nil},
          {cut, [], 2.0, nil, by_width},
          {cut, [red], 2.0, nil, nil},
          {aside, [], 2.0, nil, nil},
          {near, [], nil, nil, by_width}
        ] do
      blobs = [blob | others]

      assert {Sighting.of(percept(blobs), "Y").distance, Sighting.distance(blob, blobs),
              Sighting.distance(blob, blobs, 0.15, 1.0)} == {rough, measured, by_width}
    end
  end
end
