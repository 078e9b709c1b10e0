defmodule Vision.PhotographsTest do
  @moduledoc "Real photographs and a real recording, with what a person sees in them."
  use ExUnit.Case, async: true
  alias Vision.{Backend, Blobs, Colours, Filter, Photos}
  @moduletag :slow

  @moduletag Photos.tags(~w(smarties.png fruits.jpg vtest.avi))

  # Centres read off the picture by eye.
  @whole_sweets %{
    "Red" => [{33, 229}, {98, 259}, {288, 214}, {220, 306}],
    "Orange" => [{205, 211}, {134, 327}],
    "Green" => [{268, 118}, {386, 170}],
    "Blue" => [{377, 82}, {348, 238}, {294, 321}],
    "Brown" => [{152, 272}]
  }
  @cut_sweets %{"Green" => {15, 344}, "Brown" => {77, 348}}

  defp colours(file, options) do
    {:ok, colours} = Colours.read(Path.expand("../fixtures/#{file}", __DIR__), options)
    colours
  end

  defp look(photo, colours, options \\ []) do
    me = self()
    {:ok, summary} = Blobs.run(Photos.path(photo), colours, &send(me, {:seen, &1}), options)
    summary
  end

  test "each sweet is found where it lies, and none besides" do
    %{frames: 1, last: %{frame: frame, blobs: blobs}} =
      look("smarties.png", colours("smarties.txt", min_area: 400))

    assert {frame.width, frame.height} == {412, 356}

    # The shaded side of an orange sweet is as red as a red one, but smaller than a sweet.
    whole = Filter.least_area(blobs, 1000)
    assert length(whole) == 12

    for {colour, places} <- @whole_sweets do
      found = for blob <- Filter.colour(whole, colour), do: {blob.x, blob.y}
      assert length(found) == length(places)

      for place <- places,
          do: assert(Enum.any?(found, &near?(&1, place, 8)), "#{colour} at #{inspect(place)}")
    end

    for {colour, place} <- @cut_sweets do
      assert [blob] = Enum.filter(Filter.colour(blobs, colour), &(&1.bottom == 355))
      assert blob.clipped? and near?({blob.x, blob.y}, place, 6)
    end
  end

  test "every backend that is there agrees with the reference on photographs" do
    others = Enum.filter([Backend.Nx, Backend.Evision], &Code.ensure_loaded?/1)

    for {photo, file} <- [{"smarties.png", "smarties.txt"}, {"fruits.jpg", "fruits.txt"}] do
      colours = colours(file, min_area: 1)
      %{last: %{frame: frame, blobs: blobs}} = look(photo, colours)

      for backend <- [Backend.Reference, Backend.Native | others],
          do: assert({:ok, ^blobs} = Vision.blobs(frame, colours, backend))
    end
  end

  test "the largest blob of each colour is that fruit" do
    %{last: %{blobs: blobs}} = look("fruits.jpg", colours("fruits.txt", min_area: 2000))

    for {colour, place, reach} <- [
          {"Orange", {205, 260}, 20},
          {"Banana", {50, 160}, 20},
          {"Lime", {430, 200}, 20},
          {"Lemon", {425, 365}, 20},
          {"Kiwi", {50, 385}, 20}
        ] do
      blob = blobs |> Filter.colour(colour) |> Filter.largest()
      assert near?({blob.x, blob.y}, place, reach), "#{colour} at #{blob.x}, #{blob.y}"
    end

    # The slice in front and the whole orange behind it.
    assert [%{share: slice}, %{clipped?: true}] = Filter.colour(blobs, "Orange")
    assert slice > 0.2
  end

  test "every frame of a recording, with memory that does not grow" do
    me = self()

    report = fn seen ->
      sheet =
        seen.blobs |> Filter.colour("Sheet") |> Enum.filter(&near?({&1.x, &1.y}, {338, 459}, 12))

      send(me, {:seen, seen.number, seen.at_s, length(sheet)})
      if rem(seen.number, 100) == 50, do: send(me, {:memory, :erlang.memory(:binary)})
    end

    {:ok, summary} = Blobs.run(Photos.path("vtest.avi"), colours("walkers.txt", []), report)
    assert summary.frames == 795
    assert summary.last.number == 794
    assert_in_delta summary.last.at_s, 79.4, 1.0e-9

    # A yellow sheet lies on the lawn all the time; once somebody walks before it.
    sheets = for {:seen, _number, _at_s, count} <- messages(), do: count
    assert Enum.count(sheets, &(&1 == 1)) > 770

    memory = for {:memory, bytes} <- messages(), do: bytes
    # A frame is 0.9 MB: were a tenth of them kept, this would be 80 MB.
    assert List.last(memory) - hd(memory) < 20_000_000
  end

  defp near?({x, y}, {at_x, at_y}, reach), do: abs(x - at_x) <= reach and abs(y - at_y) <= reach

  defp messages do
    {:messages, messages} = Process.info(self(), :messages)
    messages
  end
end
