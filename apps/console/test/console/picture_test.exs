defmodule Console.PictureTest do
  use ExUnit.Case, async: true
  alias Console.{MapSheet, Picture, Runs}

  doctest Console.Picture.MapView
  doctest Console.Picture.Floorplan
  doctest Console.Picture.Svg
  doctest Console.Picture
  doctest Console.Picture.Colours

  @sheet Path.expand("../../../../docs/images/maps.svg", __DIR__)

  test "the sheet of maps in the user guide shows the maps as they are" do
    drawn = IO.iodata_to_binary(MapSheet.draw())

    assert File.read!(@sheet) == drawn,
           "write it anew: MIX_ENV=test mix run --no-start -e " <>
             ~s|'File.write!("docs/images/maps.svg", Console.MapSheet.draw())'|

    document = parse(drawn)
    for name <- Sim.Floorplan.Maps.names(), do: assert(drawn =~ ">#{name}, ")
    assert count(document, "//path") == length(Sim.Floorplan.Maps.names())
  end

  # Raises on anything that is not well-formed XML.
  defp parse(drawing) do
    {document, []} =
      drawing |> IO.iodata_to_binary() |> :binary.bin_to_list() |> :xmerl_scan.string(quiet: true)

    document
  end

  defp count(document, path), do: length(:xmerl_xpath.string(to_charlist(path), document))

  test "every robot and the landmark have a path, and stages are marked on floor and plot" do
    document =
      "--move 3,2@30 --kill mag2@60"
      |> Runs.track()
      |> Picture.draw("a <title> & more")
      |> parse()

    assert count(document, "/svg") == 1
    # Six paths, the landmark's, and the two curves of the error.
    assert count(document, "//polyline") >= 9
    assert count(document, "//text[.='killed: mag2']") == 1
    assert count(document, "//text[.='formation error (m)']") == 1
    assert count(document, "//text[.='simulated time (s)']") == 1
    assert count(document, "//text[.='a <title> & more']") == 1
  end

  test "fleets of one and of a hundred, with and without a landmark" do
    for line <- ["--robots 1", "--robots 100 --duration 20", "--landmark none --duration 20"] do
      track = Runs.track(line)
      document = track |> Picture.draw(line) |> parse()
      assert count(document, "//polyline") >= length(track.last.robots)
    end
  end

  test "a mission without a formation has neither its plot nor its signs" do
    texts = fn line ->
      document = line |> Runs.track() |> Picture.draw("") |> parse()

      for text <- ["start", "place in the formation", "landmark", "formation error (m)"],
          do: count(document, "//text[.='#{text}']")
    end

    assert texts.("--mission patrol --landmark none --duration 10") == [1, 0, 0, 0]
    assert texts.("--duration 60") == [1, 1, 1, 1]
  end

  test "long waits add no points to a path" do
    short = Runs.track("--landmark none --duration 10")
    assert Enum.all?(Map.values(short.ways), &(length(&1) < 5))
  end
end
