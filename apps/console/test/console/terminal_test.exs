defmodule Console.TerminalTest do
  use ExUnit.Case, async: true
  alias Console.{FakeTrial, Runs, Terminal}
  alias Console.Terminal.{Canvas, Editor, Style}

  doctest Console
  doctest Console.Prompt
  doctest Console.Cli.Progress
  doctest Console.Terminal
  doctest Console.Terminal.Canvas
  doctest Console.Terminal.Editor
  doctest Console.Terminal.Style

  defp screen(scene, columns, rows, more \\ []) do
    view = struct!(%Terminal{columns: columns, rows: rows}, more)
    {rows, _view} = Terminal.rows(scene, view)
    Enum.map(rows, &Style.plain/1)
  end

  test "fills every size exactly, with any fleet" do
    for count <- [1, 6, 100], {columns, rows} <- [{80, 24}, {60, 20}, {200, 60}, {40, 12}] do
      scene = Runs.scene("--robots #{count}", 12)
      {text, _view} = Terminal.frame(scene, %Terminal{columns: columns, rows: rows})
      text = IO.iodata_to_binary(text)
      assert length(screen(scene, columns, rows)) == rows

      places =
        Regex.scan(~r/\e\[(\d+);1H/, text) |> Enum.map(fn [_, row] -> String.to_integer(row) end)

      assert Enum.take(places, rows) == Enum.to_list(1..rows)

      for row <- String.split(text, ~r/\e\[\d+;1H/) |> tl() |> Enum.take(rows) do
        assert row |> String.replace(~r/\e\[[?\d;]*[A-Za-z]/, "") |> String.length() == columns
      end
    end
  end

  test "shows leader, error, robots and the landmark" do
    text = "" |> Runs.scene(12) |> screen(80, 24) |> Enum.join("\n")

    for word <- [
          "mag1 leads",
          "error ",
          "column 1.0 m",
          "◆",
          "★ mag1",
          "min3",
          "█",
          "12.0 s"
        ],
        do: assert(text =~ word)

    assert text =~ "Try:  kill leader"
  end

  test "an emergency stop is the first line of every view, and each robot that it holds says so" do
    scene = Runs.scene("", 12)
    held = Enum.map(scene.robots, &%{&1 | state: :estop})
    stop = %{held: Enum.map(held, & &1.id), of: 6, since_ms: scene.at_ms - 5_000, by: ["base"]}
    scene = %{scene | robots: held, estop: stop}
    told = "EMERGENCY STOP for 5 s, called by base: 6 of 6 robots held; reset frees them"
    [first | rest] = screen(scene, 80, 24)
    assert String.trim(first) == told
    assert Enum.count(rest, &(&1 =~ ~r/(mag|min)\d +E-STOP/)) == 6
    assert hd(Console.Cli.Format.everybody(scene)) == told
    assert Console.Cli.Format.status(scene) =~ told
    assert Console.Page.State.scene(scene, nil, nil, 0) =~ told
  end

  test "lines that do not fit are shown page by page, and nothing is cut without a word" do
    scene = Runs.scene("", 12)
    help = Console.Prompt.help()
    view = Terminal.show(%Terminal{columns: 80, rows: 24}, help)

    {pages, view} =
      Enum.map_reduce(1..3, view, fn _page, view ->
        {rows, view} = Terminal.rows(scene, view)
        {Enum.map(rows, &Style.plain/1), Terminal.turn(view)}
      end)

    [first, second, third] = pages
    assert Enum.any?(first, &(&1 =~ ~r/\(\d+ lines more: press Enter\)/))
    shown = Enum.map_join(pages, "\n", &Enum.join(&1, "\n"))
    for line <- help, do: assert(shown =~ line and String.length(line) <= 77)
    assert Enum.any?(second ++ third, &(&1 =~ "(press Enter to return to the map)"))
    assert view.overlay == nil
  end

  test "dead robots are shown where they lie" do
    text = "--kill mag2@3" |> Runs.scene(12) |> screen(80, 24) |> Enum.join("\n")
    assert text =~ "✗"
    assert text =~ ~r/mag2\s+dead/
  end

  test "each robot shows how sure it is, and an unsure one is shown as not sure" do
    scene = Runs.scene("", 12)

    for columns <- [80, 120] do
      text = scene |> screen(columns, 24) |> Enum.join("\n")
      assert text =~ ~r/robot  does +off +± sees %/
      assert text =~ ~r/mag2 +follow +\d+\.\d\d ±0\.04 ◆ 0\.9/

      rows = scene |> doubt(:mag3, 0.6184) |> screen(columns, 24)
      # It comes right after the leader, because it needs attention.
      at = fn name -> Enum.find_index(rows, &(&1 =~ ~r/ #{name} +(lead|not sure|follow) /)) end
      assert at.("mag1") < at.("mag3") and at.("mag3") < at.("mag2")
      assert Enum.at(rows, at.("mag3")) =~ ~r/mag3 +not sure +\d+\.\d\d ±0\.62 ◆/
    end
  end

  test "one that is not sure of its place says why, in a row that keeps the width" do
    scene = "" |> Runs.scene(12) |> doubt(:mag3, 0.62)
    why = "lost: a third of what it hears fits the plan"

    told = fn scene, why ->
      update_in(scene.robots, &for(r <- &1, do: Map.put(r, :says, r.id == :mag3 && why)))
    end

    rows = scene |> told.(why) |> screen(80, 24)
    at = Enum.find_index(rows, &(&1 =~ "not sure"))
    assert Enum.at(rows, at + 1) =~ ~r/  lost: a third of what it hears fi…$/
    assert String.length(Enum.at(rows, at + 1)) <= 80

    # What a robot says that is sure is not for the table.
    sure = update_in(scene.robots, &for(r <- &1, do: %{r | state: :follow}))
    refute sure |> told.(why) |> screen(80, 24) |> Enum.any?(&(&1 =~ "lost: a third"))

    # Where rows are few, no reason stands without its robot.
    for rows <- 8..24, screen = scene |> told.(why) |> screen(80, rows) do
      assert length(screen) == rows
      reasons = Enum.count(screen, &(&1 =~ "lost: a third"))
      assert reasons <= Enum.count(screen, &(&1 =~ "not sure"))
    end
  end

  test "however unsure robots are, the table keeps its width" do
    scene = Runs.scene("", 12)

    for {metres, word} <- [{0.0, "±0.00"}, {9.996, "±10.0"}, {99.96, "±100"}, {1.0e6, "±9999"}] do
      rows = scene |> doubt(:mag3, metres) |> screen(80, 24)
      assert [row] = Enum.filter(rows, &(&1 =~ "not sure"))
      assert row =~ " #{word} ◆" and String.length(String.trim_trailing(row)) <= 80
    end

    refute scene |> doubt(:mag3, nil) |> screen(80, 24) |> Enum.any?(&(&1 =~ ~r/not sure.*±/))
  end

  defp doubt(scene, id, metres) do
    robots =
      for robot <- scene.robots,
          do: if(robot.id == id, do: %{robot | state: :unsure, uncertainty: metres}, else: robot)

    %{scene | robots: robots}
  end

  test "of a hundred robots, those without a row are counted" do
    text = "--robots 100" |> Runs.scene(12) |> screen(80, 24) |> Enum.join("\n")
    assert text =~ ~r/… and \d+: \d+ follow/
  end

  test "the last line is what is typed, with its end visible" do
    editor =
      Enum.reduce(String.graphemes("goto mag1 1,2"), Editor.new([]), &elem(Editor.key(&2, &1), 1))

    assert List.last(screen(Runs.scene("", 1), 80, 24, editor: editor)) == "> goto mag1 1,2"

    long =
      Enum.reduce(1..100, Editor.new([]), fn _, editor -> elem(Editor.key(editor, "x"), 1) end)

    assert String.length(List.last(screen(Runs.scene("", 1), 40, 24, editor: long))) < 40
  end

  test "the walls are shown all around, whatever the screen size" do
    scene = Runs.scene("", 1)
    room = FakeTrial.room("hall", 18.0, 18.0)

    for {columns, rows} <- [{41, 16}, {38, 16}, {80, 30}, {84, 27}] do
      row = Canvas.floor(nil, room, scene, columns, rows).walls |> Map.keys()
      middle = for {column, row} <- row, row == div(rows, 2), do: column
      assert Enum.min(middle) < div(columns, 2) and Enum.max(middle) > div(columns, 2)
    end
  end

  test "long answers and lists are broken between words" do
    text = "mag1: a line " <> String.duplicate("with many words ", 8) <> "at last"
    scene = Runs.scene("", 1)
    shown = scene |> screen(80, 24, overlay: [text]) |> Enum.join("\n")
    assert shown =~ "at last"
    answer = "no robot at all, but " <> String.duplicate("word ", 12) <> "did you mean mag1?"
    assert scene |> screen(80, 24, messages: [{answer, :bad}]) |> Enum.join(" ") =~ "mean mag1?"
  end

  test "the floor is made once as long as nothing changes" do
    scene = Runs.scene("", 1)
    room = FakeTrial.room("hall", 16.0, 12.0)
    floor = Canvas.floor(nil, room, scene, 40, 15)
    assert Canvas.floor(floor, room, scene, 40, 15) == floor
    refute Canvas.floor(floor, room, scene, 50, 15) == floor
  end

  test "on a floor too large for the screen only the fleet's part is shown" do
    scene = Runs.scene("", 1)
    floor = Canvas.floor(nil, FakeTrial.room("huge", 300.0, 200.0), scene, 40, 15)
    assert floor.scale < 1.0
  end

  test "keys edit the line" do
    type = fn keys ->
      Enum.reduce(keys, Editor.new(["formation"]), &elem(Editor.key(&2, &1), 1)) |> Editor.text()
    end

    assert type.(["a", "b", "\e", "[", "D", "x"]) == "axb"
    assert type.(["a", "b", <<127>>]) == "a"
    assert type.(["a", " ", "b", <<23>>]) == "a "
    assert type.(["a", "b", <<21>>]) == ""
    assert type.(["f", "o", "\t"]) == "formation "
    robots = Editor.new(["mag1", "mag2", "min1"])
    {nil, typed} = Editor.key(robots, "m")
    assert {{:choices, ["mag1", "mag2", "min1"]}, ^typed} = Editor.key(typed, "\t")
    {nil, typed} = Editor.key(typed, "a")
    {nil, typed} = Editor.key(typed, "\t")
    assert Editor.text(typed) == "mag"
    assert type.(["a", "\r", "\e", "[", "A"]) == "a"
    assert type.(["a", "\e", "[", "H", "\e", "[", "3", "~", "ü"]) == "ü"
    assert {:quit, _editor} = Editor.key(Editor.new([]), <<3>>)
    assert {:quit, _editor} = Editor.key(Editor.new([]), <<4>>)
  end
end
