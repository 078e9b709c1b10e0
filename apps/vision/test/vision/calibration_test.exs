defmodule Vision.CalibrationTest do
  use ExUnit.Case, async: true
  alias Hal.Frame
  alias Vision.{Blobs, Calibration, Colours, Filter, Photos, Picture}
  alias Vision.Calibration.Match
  alias Vision.Colours.Edit

  doctest Vision.Calibration
  doctest Vision.Calibration.Sample
  doctest Vision.Colours.Edit

  @photos ~w(smarties.png)
  @none elem(Colours.new([%{name: "None", y: {0, 0}, u: {0, 0}, v: {0, 0}}]), 1)

  # Discs on a ground, RGB, with noise of so many values of each channel.
  defp painted(discs, ground, noise \\ 0, seed \\ 1) do
    state = :rand.seed_s(:exsss, {seed, 2, 3})

    {bytes, _state} =
      for y <- 0..119, x <- 0..159, reduce: {[], state} do
        {bytes, state} ->
          rgb =
            Enum.find_value(discs, ground, fn {cx, cy, radius, rgb} ->
              if (x - cx) ** 2 + (y - cy) ** 2 <= radius * radius, do: rgb
            end)

          {shaken, state} =
            Enum.map_reduce(Tuple.to_list(rgb), state, fn value, state ->
              {draw, state} = :rand.normal_s(state)
              {(value + draw * noise) |> round() |> max(0) |> min(255), state}
            end)

          {[bytes | shaken], state}
      end

    {:ok, frame} = Frame.new(:rgb24, 160, 120, IO.iodata_to_binary(bytes), 0)
    frame
  end

  # The same scene in other light, of another colour too: what a camera makes of red, green and blue.
  defp lit(frame, {r, g, b}) do
    rgb = Picture.draw(frame, [], @none)
    scale = fn value, by -> (value * by) |> round() |> min(255) end
    bytes = for <<x, y, z <- rgb>>, into: <<>>, do: <<scale.(x, r), scale.(y, g), scale.(z, b)>>
    {:ok, frame} = Frame.new(:rgb24, frame.width, frame.height, bytes, 0)
    frame
  end

  defp lit(frame, gain), do: lit(frame, {gain, gain, gain})

  defp blobs(frame, class, min_area) do
    {:ok, colours} = Colours.new([class], min_area: min_area)
    {:ok, blobs} = Vision.blobs(frame, colours)
    blobs
  end

  # The photograph, and what it is in other light: once for all tests.
  setup_all do
    if Photos.tags(@photos)[:skip], do: :ok, else: photograph()
  end

  defp photograph do
    me = self()
    {:ok, _} = Blobs.run(Photos.path("smarties.png"), @none, &send(me, {:frame, &1.frame}))
    assert_received {:frame, frame}
    %{frame: frame, lit: for(gain <- [0.85, 1.0, 1.15], do: {gain, lit(frame, gain)})}
  end

  @yellow {220, 205, 90}
  @red {200, 40, 40}
  @wall {120, 125, 130}

  test "a disc is found again in any light that the limits put up with, and nothing else" do
    frame = painted([{80, 60, 20, @yellow}, {30, 30, 12, @red}], @wall, 6)
    {:ok, found} = Calibration.find([frame], [{:box, {70, 50, 20, 20}}], "Yellow")
    assert found.tolerance >= 0.3
    assert found.share > 0.95
    assert found.match.others == []
    assert found.match.hit / found.match.inside > 0.97

    for gain <- [0.65, 0.8, 1.0, 1.1, {1.08, 1.0, 0.92}, {0.9, 0.95, 1.0}] do
      assert [blob] = blobs(lit(frame, gain), found.class, 20)
      assert_in_delta blob.x, 80, 1
      assert_in_delta blob.y, 60, 1
      assert blob.area > 0.9 * 3.1416 * 400
    end
  end

  test "a third of a box that is background or glare moves no limit by much" do
    frame = painted([{80, 60, 20, @yellow}], @wall, 4)
    {:ok, clean} = Calibration.find([frame], [{:box, {72, 52, 16, 16}}], "Yellow", tolerance: 0.0)

    # Corners and sides of the box show the wall; a spot shines.
    glare = painted([{76, 54, 4, {255, 255, 255}}, {80, 60, 20, @yellow}], @wall, 4)
    {:ok, loose} = Calibration.find([glare], [{:box, {57, 37, 46, 46}}], "Yellow", tolerance: 0.0)
    assert loose.share < 0.66

    for channel <- [:y, :u, :v] do
      {low, high} = clean.class[channel]
      {loose_low, loose_high} = loose.class[channel]

      assert abs(low - loose_low) <= 6 and abs(high - loose_high) <= 6,
             "#{channel} #{inspect(loose)}"
    end
  end

  test "points say which of two colours in a box is meant" do
    frame = painted([{80, 60, 12, @yellow}], @red, 4)
    box = {:box, {60, 40, 40, 40}}
    {:ok, red} = Calibration.find([frame], [box], "It")
    {:ok, yellow} = Calibration.find([frame], [box, {:point, {80, 60}}], "It")
    assert {_, u} = red.class.u
    assert {yellow_u, _} = yellow.class.u
    assert yellow_u < u
    assert [blob] = blobs(frame, yellow.class, 20)
    assert_in_delta blob.x, 80, 1
  end

  test "frames are looked at together: noise of each counts" do
    frames = for seed <- 1..5, do: painted([{80, 60, 20, @yellow}], @wall, 8, seed)
    {:ok, found} = Calibration.find(frames, [{:box, {75, 55, 10, 10}}], "Yellow")
    assert found.pixels == 500
  end

  test "a background of nearly the same colour narrows the light, and one of the same is told" do
    near = painted([{80, 60, 20, @yellow}, {20, 100, 10, {175, 165, 60}}], @wall, 2)
    {:ok, found} = Calibration.find([near], [{:box, {72, 52, 16, 16}}], "Yellow")
    assert found.tolerance < 0.2
    assert found.match.others == []

    {:ok, wide} = Calibration.find([near], [{:box, {72, 52, 16, 16}}], "Yellow", tolerance: 0.4)
    assert [%{x: x, y: y}] = wide.match.others
    assert_in_delta x, 20, 1
    assert_in_delta y, 100, 1

    same = painted([{80, 60, 20, @yellow}, {20, 100, 10, @yellow}], @wall, 2)
    {:ok, found} = Calibration.find([same], [{:box, {72, 52, 16, 16}}], "Yellow")
    assert found.match.background > 250
    # That cannot be told by any limits, and does not narrow them.
    assert found.tolerance >= 0.3
  end

  test "a thing that runs into its background is no thing" do
    # A wall that is the disc's own colour in half the light.
    frame = painted([{80, 60, 14, @yellow}], {150, 140, 61}, 2)
    {:ok, found} = Calibration.find([frame], [{:box, {74, 54, 12, 12}}], "Yellow")
    assert [blob] = found.match.blobs
    assert blob.area < 2 * 3.1416 * 14 * 14
    assert Match.same?({[], []}, {[], []})
  end

  test "places outside, and samples of nothing, are told" do
    frame = painted([], @wall)

    assert Calibration.find([frame], [{:box, {150, 0, 11, 5}}], "X") ==
             {:error, "box 150,0,11,5 is not in the picture, which is 160 by 120 pixels"}

    assert Calibration.find([frame], [{:point, {0, 120}}], "X") ==
             {:error, "point 0,120 is not in the picture, which is 160 by 120 pixels"}

    assert Calibration.find([frame], [{:box, {0, 0, 2, 2}}], "X") ==
             {:error, "only 4 pixels of the sample are alike: 9 are needed"}
  end

  test "a colour file keeps its comments and its other colours" do
    text =
      "# Ours.\n\n[Colors]\n(255,0,0) 0.5 4 Red\n(0,0,255) 0.5 4 Blue\n\n[Thresholds]\n( 40:160, 81:125,165:255)\n(1:2,3:4,5:6)\n# end\n"

    class = %{
      name: "Blue",
      rgb: {0, 0, 255},
      merge: 0.5,
      expected: 10,
      y: {20, 190},
      u: {165, 245},
      v: {30, 125}
    }

    assert {:ok, changed} = Edit.put(text, class)
    assert changed == String.replace(text, "(1:2,3:4,5:6)", "( 20:190,165:245, 30:125)")

    assert {:ok, added} = Edit.put(text, %{class | name: "Sea"})
    assert {:ok, colours} = Colours.parse(added)

    assert [%{name: "Red"}, %{name: "Blue", y: {1, 2}}, %{name: "Sea", u: {165, 245}}] =
             colours.classes

    assert String.starts_with?(added, "# Ours.\n") and added =~ "# end\n"

    # A last line without an end, and Windows' ends.
    for text <- [String.trim_trailing(text, "# end\n"), String.replace(text, "\n", "\r\n")] do
      text = String.trim_trailing(text)
      assert {:ok, added} = Edit.put(text, %{class | name: "Sea"})
      assert {:ok, %{classes: [_, _, %{name: "Sea"}]}} = Colours.parse(added)
    end

    assert {:error, line} = Edit.put(text, %{class | name: "two words"})
    assert line =~ "expected one word of up to 60 letters"
    assert {:error, _line} = Edit.put("[Colors]\nnothing", class)
  end

  test "no more than 32 colours" do
    {:ok, text} =
      Enum.reduce(1..32, {:ok, ""}, fn n, {:ok, text} ->
        Edit.put(text, %{
          name: "C#{n}",
          rgb: {1, 2, 3},
          merge: 0.5,
          expected: 1,
          y: {n, n},
          u: {0, 9},
          v: {0, 9}
        })
      end)

    class = %{
      name: "C33",
      rgb: {1, 2, 3},
      merge: 0.5,
      expected: 1,
      y: {1, 2},
      u: {0, 9},
      v: {0, 9}
    }

    assert {:error, line} = Edit.put(text, class)
    assert line =~ "expected 1 to 32 colours, got 33"
  end

  describe "photographs" do
    @describetag Photos.tags(@photos)

    # Middles of one sweet each, and of all of its colour that are whole, read off the picture by eye.
    @sweets %{
      "Red" => {{98, 259}, [{33, 229}, {98, 259}, {288, 214}, {220, 306}]},
      "Orange" => {{205, 208}, [{205, 211}, {134, 327}]},
      "Green" => {{268, 118}, [{268, 118}, {386, 170}]},
      "Blue" => {{294, 318}, [{377, 82}, {348, 238}, {294, 321}]},
      "Brown" => {{152, 272}, [{152, 272}]}
    }

    for {name, _} <- @sweets do
      test "one #{name} sweet shows what all #{name} sweets look like, in changed light too",
           %{frame: frame, lit: lit} do
        name = unquote(name)
        {{x, y}, places} = @sweets[name]
        {:ok, found} = Calibration.find([frame], [{:box, {x - 14, y - 14, 28, 28}}], name)
        assert found.match.hit / found.match.inside > 0.85

        for {gain, frame} <- lit do
          whole = Filter.least_area(blobs(frame, found.class, 400), 1000)
          places_found = for blob <- whole, do: {blob.x, blob.y}
          assert length(whole) == length(places), "#{name} at #{gain}: #{inspect(places_found)}"

          for {px, py} <- places do
            assert Enum.any?(whole, fn blob -> abs(blob.x - px) < 10 and abs(blob.y - py) < 10 end),
                   "#{name} #{px},#{py} at #{gain}: #{inspect(places_found)} #{inspect(found.class)}"
          end
        end
      end
    end
  end

  test "a preview shows what is taken for the colour" do
    frame = painted([{80, 60, 20, @yellow}], @wall)
    {:ok, found} = Calibration.find([frame], [{:box, {72, 52, 16, 16}}], "Yellow")
    {:ok, colours} = Colours.new([found.class])
    rgb = Picture.draw(frame, [], colours, classified: true, boxes: [{72, 52, 87, 67}])

    at = fn x, y ->
      rgb |> binary_part(3 * (y * 160 + x), 3) |> :binary.bin_to_list() |> List.to_tuple()
    end

    assert at.(80, 60) == found.class.rgb
    assert at.(72, 60) == {255, 255, 255}
    assert {grey, grey, grey} = at.(10, 10)
    assert grey < 60
  end
end
