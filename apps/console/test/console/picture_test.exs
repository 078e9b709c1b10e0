defmodule Console.PictureTest do
  use ExUnit.Case, async: true
  alias Console.{MapSheet, Picture, Runs}
  alias Console.Picture.{MapView, RunTrack}
  alias Hal.Pose
  alias Sim.Scene

  doctest Console.Picture.MapView
  doctest Console.Picture.Floorplan
  doctest Console.Picture.Svg
  doctest Console.Picture
  doctest Console.Picture.Colours
  doctest Console.Picture.Account

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
      |> Picture.draw({"a <title> & more", "plan known, noise off"})
      |> parse()

    assert count(document, "/svg") == 1
    # Six paths, the landmark's, and the two curves of the error.
    assert count(document, "//polyline") >= 9
    assert count(document, "//text[.='killed: mag2']") == 1
    assert count(document, "//text[.='formation error (m)']") == 1
    assert count(document, "//text[.='simulated time (s)']") == 1
    assert count(document, "//text[.='a <title> & more']") == 1
    assert count(document, "//text[.='plan known, noise off']") == 1
  end

  test "a film moves every robot and the landmark, shows what happened from when it did, and ends in one line without a map" do
    scenes = for at_s <- 0..70//2, do: Runs.scene("--move 3,2@30 --kill mag2@60", at_s)
    {:ok, film} = Console.Picture.Film.draw(scenes, "6 robots & a title")
    assert film == elem(Console.Picture.Film.draw(scenes, "6 robots & a title"), 1)
    document = parse(film)
    moves = "//animateTransform[@type='translate']"
    # Six robots, the landmark, and the cursor of the plot.
    assert count(document, moves) == 8
    assert count(document, "//animateTransform[@type='rotate']") == 6
    assert count(document, "//text[.='6 robots & a title']") == 1
    # The one that dies fades.
    assert count(document, "//animate[@attributeName='opacity']") == 1
    assert count(document, "//text[.='mag2 is dead']") == 1

    values =
      for {:xmlAttribute, :values, _, _, _, _, _, _, values, _} <-
            :xmerl_xpath.string(to_charlist(moves <> "/@values"), document),
          do: values |> to_string() |> String.split(";") |> length()

    assert Enum.frequencies(values) == %{2 => 1, length(scenes) => 7}

    assert {:error, "a film needs a second of a run at least"} =
             Console.Picture.Film.draw(Enum.take(scenes, 1), "")

    assert {:error, "only a run in lockstep can be drawn: robots of processes know no map"} =
             Console.Picture.Film.draw([%{hd(scenes) | map: nil}], "")
  end

  test "what the mission draws stands on the floor" do
    track = Runs.track("--landmark none --duration 2")
    bare = track |> Picture.draw({"", ""}) |> parse() |> count("//polyline")

    layer = [
      {:polyline, "course", [{0.0, 0.0}, {3.0, 2.0}]},
      {:points, "points", [{3.0, 2.0, "1: 4 s ago"}]},
      {:cells, "mapped", 1.6, [{0.8, 0.8}, {0.8, 2.4}]}
    ]

    document =
      track
      |> put_in([Access.key!(:last), Access.key!(:layer)], layer)
      |> Picture.draw({"", ""})
      |> parse()

    assert count(document, "//polyline") == bare + 1
    assert count(document, "//text[.='1: 4 s ago']") == 1
    assert count(document, "//rect[@fill-opacity]") == 2
  end

  test "round bodies are discs, and boxes are boxes" do
    document =
      "--fleet burger:1,mag:1,min:1 --landmark none --duration 5"
      |> Runs.track()
      |> Picture.draw({"", ""})
      |> parse()

    # Where it started, and where it is.
    assert count(document, "//polygon") == 2 * 2
  end

  test "fleets of one and of a hundred, with and without a landmark" do
    for line <- ["--robots 1", "--robots 100 --duration 20", "--landmark none --duration 20"] do
      track = Runs.track(line)
      document = track |> Picture.draw({line, ""}) |> parse()
      assert count(document, "//polyline") >= length(track.last.robots)
    end
  end

  test "a mission without a formation has neither its plot nor its signs" do
    texts = fn line ->
      document = line |> Runs.track() |> Picture.draw({"", ""}) |> parse()

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

  # A robot of a scene that stands.
  defp robot(id, {x, y}, more) do
    Map.merge(
      %{
        id: id,
        pose: Pose.new(x, y, 0.0),
        radius: 0.25,
        alive: true,
        state: :follow,
        slot: nil,
        leader?: false,
        believed: Pose.new(x, y, 0.0),
        uncertainty: 0.1,
        blocked_by: nil,
        says: nil,
        size_ppm: nil
      },
      Map.new(more)
    )
  end

  # A map with a wall to the right of 3, and nothing known above 4.
  defp ground do
    %MapView{
      name: "shop",
      width: 12.0,
      height: 10.0,
      wall?: fn x, y -> x > 3.0 or y > 4.0 end,
      unknown?: fn _x, y -> y > 4.0 end
    }
  end

  # The robots come to stand at 5 s, and the run ends at 20 s.
  defp standing(robots, more \\ []) do
    scene = &struct!(%Scene{at_ms: &1, map: ground(), robots: &2}, more)
    far = for r <- robots, do: %{r | pose: Pose.new(r.pose.x - 0.5, r.pose.y, 0.0)}

    for at_ms <- [5_000, 10_000, 20_000], reduce: RunTrack.new(scene.(0, far)) do
      track -> RunTrack.add(track, scene.(at_ms, robots))
    end
  end

  defp drawn(track), do: track |> Picture.draw({"", ""}) |> IO.iodata_to_binary()

  # What is written: `{x, y, text}`, of the labels on the floor alone if so asked.
  defp texts(drawing, only \\ "") do
    for [_all, x, y, attributes, text] <-
          Regex.scan(~r/<text x="([-\d.]+)" y="([-\d.]+)"([^>]*)>([^<]*)</, drawing),
        attributes =~ only,
        do: {number(x), number(y), text}
  end

  defp number(text), do: text |> Float.parse() |> elem(0)

  test "each robot has its state, doubt and reason, and since when it stands" do
    drawing =
      [
        robot(:mag1, {0.0, 0.0}, leader?: true, state: :lead),
        robot(:mag2, {-2.0, 0.0}, state: :in_place, slot: {-2.0, 0.1}),
        robot(:mag3, {-4.0, 0.0}, state: :blocked, blocked_by: "mag2", slot: {-3.0, 0.0}),
        robot(:mag4, {0.0, -3.0},
          state: :unsure,
          uncertainty: 0.55,
          says: "in its slot, but NOT SURE of its place (±0.55 m)"
        ),
        robot(:mag5, {-3.0, -3.0}, state: :unsure, says: "lost: nothing fits")
      ]
      |> standing(leader: :mag1)
      |> drawn()

    all = for {_x, _y, text} <- texts(drawing), do: text

    for told <- [
          "mag1: leads",
          "mag2: in its place",
          "0.10 m off its place, ±0.10 m, since 5.0 s",
          "mag3: blocked by mag2",
          "mag5: lost: nothing fits",
          # On the floor, too.
          "leads",
          "in its place",
          "blocked by mag2",
          "in its slot, but NOT SURE",
          "of its place (±0.55 m)",
          "lost: nothing fits",
          "±0.10 m, since 5.0 s"
        ],
        do: assert(told in all, told)

    # Round the robot that may be 0.55 m off, and no other; and in the legend.
    assert length(String.split(drawing, ~s(stroke-dasharray="2 4"))) - 1 == 2
  end

  test "a robot that moves until the end does not stand, however slowly" do
    moving = fn at_ms -> [robot(:mag1, {at_ms / 20_000, 0.0}, state: :follow)] end
    scene = &%Scene{at_ms: &1, map: ground(), robots: moving.(&1)}

    track =
      Enum.reduce(100..20_000//100, RunTrack.new(scene.(0)), fn at_ms, track ->
        track = RunTrack.add(track, scene.(at_ms))
        assert RunTrack.since_s(track, :mag1) == nil
        track
      end)

    refute drawn(track) =~ "since"
  end

  test "where a robot believes to be is drawn, if that is more than 0.2 m off" do
    sign = "where a robot believes to be"

    for {x, told?} <- [{-1.0, true}, {-0.15, false}] do
      drawing =
        [robot(:mag1, {0.0, 0.0}, believed: Pose.new(x, 0.0, 0.0))] |> standing() |> drawn()

      assert drawing =~ sign == told?
      assert drawing =~ "1.00 m from where it" == told?
    end
  end

  test "places in walls are marked, and what is not known has a tone of its own" do
    for {slot, marked?} <- [{{2.9, 0.0}, true}, {{2.0, 0.0}, false}, {{0.0, 3.9}, true}] do
      drawing = [robot(:mag1, {0.0, 0.0}, slot: slot)] |> standing() |> drawn()
      assert drawing =~ "place in the formation that lies in a wall" == marked?
    end

    track = standing([robot(:mag1, {0.0, 3.0}, [])])
    assert drawn(track) =~ "not known, taken for wall"
    # The strip above 4 m is one tone, and the wall beside the rest is the other.
    [unknown, wall] = for tone <- ["#C3C7CE", "#4A4F57"], do: ~s(<g fill="#{tone}")
    assert [_, rest] = String.split(drawn(track), unknown, parts: 2)
    assert [_unknown, _wall] = String.split(rest, wall, parts: 2)

    known = %{ground() | unknown?: nil}
    refute drawn(%{track | first: %{track.first | map: known}}) =~ "not known"
  end

  test "a picture of a part of the map has the whole map beside it" do
    part = standing([robot(:mag1, {0.0, 0.0}, [])])
    assert drawn(part) =~ "The whole map, 12 x 10 m"
    corners = for {x, y} <- [{-5.0, -4.0}, {4.5, 3.9}], do: {x, y}
    robots = for {place, k} <- Enum.with_index(corners), do: robot(:"mag#{k}", place, [])
    refute robots |> standing() |> drawn() =~ "The whole map"
  end

  test "no label hides another, however close the robots stand" do
    for apart <- [0.6, 0.8, 1.2], n <- [4, 8, 12] do
      robots =
        for k <- 1..n do
          place = {-2.0 + apart * rem(k, 4), -1.0 + apart * div(k, 4)}
          robot(:"mag#{k}", place, state: :blocked, blocked_by: "no word of its leader")
        end

      labels =
        for {x, y, text} <- robots |> standing() |> drawn() |> texts("paint-order") do
          wide = 6.0 * String.length(text)
          {x - wide / 2, y - 9, wide, 11, text}
        end

      for {a, k} <- Enum.with_index(labels), b <- Enum.drop(labels, k + 1) do
        refute over?(a, b), "#{inspect(a)} and #{inspect(b)}, #{n} robots, #{apart} m apart"
      end

      for k <- 1..n, do: assert(Enum.any?(labels, &(elem(&1, 4) == "mag#{k}")))
    end
  end

  defp over?({x, y, wide, high, _}, {u, v, w, h, _}),
    do: x < u + w and u < x + wide and y < v + h and v < y + high

  test "the axis of errors ends beyond the largest of them, and no peak is left out" do
    # One tick in 30,000.
    errors = for k <- 30_000..1//-1, do: {k / 10, 0.3, if(k == 20_001, do: 3.2, else: 0.4)}
    track = %{standing([robot(:mag1, {0.0, 0.0}, [])]) | errors: errors}
    track = %{track | last: %{track.last | at_ms: 3_400_000}}
    drawing = drawn(track)
    assert {-6.0, 4.0, "4"} in texts(drawing)
    # At its root of the axis' height of 190.
    assert drawing =~ ",#{Float.round(190 - :math.sqrt(3.2 / 4) * 190, 2)} "
    assert Enum.any?(texts(drawing), &match?({_x, _y, "3400"}, &1))
  end
end
