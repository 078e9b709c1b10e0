defmodule Bench.VisionTest do
  use ExUnit.Case, async: true
  import ExUnit.CaptureIO
  alias Bench.Vision
  alias Bench.Vision.{Beside, Frames, Report, Runner}
  @moduletag :slow
  doctest Bench.Vision.Beside
  doctest Bench.Vision.Frames
  doctest Bench.Vision.Report

  setup_all do
    {:ok, easy} = Vision.work(:easy, "no photo")
    {:ok, speckle} = Vision.work(:speckle, "no photo")
    %{easy: easy, speckle: speckle}
  end

  test "the kernel alone finds what the call finds, in each copy", %{easy: easy, speckle: speckle} do
    for work <- [easy, speckle] do
      %{tables: tables, min_area: min_area} = work.colours

      found =
        work.copies
        |> Vision.Kernel.find(640, 480, tables, min_area)
        |> Enum.map(&elem(&1, 1))
        |> Enum.reverse()

      called =
        for frame <- work.frames do
          {:ok, regions} = Elixir.Vision.Backend.Native.regions(frame, work.colours)
          length(regions)
        end

      assert found == called
      # A rolled copy may cut some of the nine in two.
      assert hd(found) == 9 or work == speckle
      assert Enum.all?(found, &(&1 in 9..30))
    end

    assert_raise ArgumentError, fn -> Vision.Kernel.find([<<1>>], 640, 480, <<>>, 20) end

    assert_raise ArgumentError, fn ->
      Vision.Kernel.find([<<1>>], 640, 480, easy.colours.tables, 20)
    end
  end

  test "speckles are 5 % of the pixels, and in all classes", %{easy: easy, speckle: speckle} do
    changed =
      for {a, b} <- Enum.zip(pairs(hd(easy.copies)), pairs(hd(speckle.copies))), a != b, do: b

    # Of two pixels, one or both.
    assert_in_delta length(changed) / (320 * 480), 1 - 0.95 * 0.95, 0.003

    assert changed |> Enum.map(fn <<_y0, u, _y1, v>> -> {u, v} end) |> Enum.uniq() |> length() ==
             8
  end

  defp pairs(bytes), do: for(<<pair::binary-4 <- bytes>>, do: pair)

  test "the further classes of a drawn frame are in none of its pixels", %{easy: easy} do
    {:ok, more} = Vision.work(:easy, "no photo", 32)
    assert length(more.colours.classes) == 32

    for {frame, same} <- Enum.zip(Enum.take(easy.frames, 2), more.frames) do
      {:ok, regions} = Elixir.Vision.Backend.Native.regions(frame, easy.colours)
      assert {:ok, ^regions} = Elixir.Vision.Backend.Native.regions(same, more.colours)
    end
  end

  test "the classes of a picture are its own most frequent ones" do
    pair = fn u, v, times -> :binary.copy(<<100, u, 100, v>>, times) end

    bytes =
      pair.(130, 125, 500) <> pair.(70, 190, 300) <> pair.(20, 60, 200) <> pair.(70, 190, 99)

    [first, second | rest] = Frames.classes_of(bytes)
    assert {first.u, first.v} == {{56, 80}, {176, 200}}
    assert {second.u, second.v} == {{16, 40}, {56, 80}}
    assert length(rest) == 6
  end

  @tag :tmp_dir
  test "a run has figures of what is here, and says what is not", %{easy: easy, tmp_dir: folder} do
    program = Path.join(folder, "beside")

    File.write!(
      program,
      "#!/bin/sh\n[ -s \"$1\" ] && [ $(wc -l <\"$2\") = 8 ] && echo 20 && echo $5\n"
    )

    File.chmod!(program, 0o755)
    beside = %{name: :beside, says: "another", pace: :slow}
    broken = %{name: :broken, says: "broken", pace: :slow}

    programs = %{
      opencv: nil,
      beside: {program, []},
      broken: {"/bin/sh", ["-c", "echo no; false"]}
    }

    ways = Vision.ways() ++ [beside, broken]
    me = self()
    results = Runner.run(easy, ways, programs, folder, 2, &send(me, &1))
    for round <- 0..2, do: assert_received(^round)

    for name <- [:copy, :kernel, :call, :blobs, :alone] do
      assert {:ok, %{1 => %{us: us}, 2 => _}} = results[name]
      assert us > 0
    end

    assert results.opencv == {:absent, "not here"}
    assert results.beside == {:ok, %{1 => %{us: 20.0, faults: nil}}}
    assert results.broken == {:absent, "1: no"}
    measured = [easy: results, photograph: {:absent, "no.jpg is not there"}]
    lines = ways |> Report.draw(measured) |> String.split("\n", trim: true)
    table = Enum.filter(lines, &String.starts_with?(&1, "|"))
    assert length(table) == 2 + length(ways)
    assert table |> Enum.map(&length(String.split(&1, "|"))) |> Enum.uniq() == [5]
    assert Enum.any?(table, &(&1 =~ ~r/kernel, called from C \| \d+ \(1.00; \d+\) \| –/))
    assert "No figures of the photograph: no.jpg is not there." in lines
    json = Hal.Json.encode!(Report.term(ways, measured, %{rounds: 2}))
    assert json =~ ~s({"frame":"easy","way":"opencv","absent":"not here"})
  end

  @tag :tmp_dir
  test "the command prints a table and writes its figures", %{tmp_dir: folder} do
    json = Path.join(folder, "vision.json")
    words = ~w(--rounds 1 --frames easy --json) ++ [json]
    text = capture_io(fn -> assert Vision.Main.run(words) == :ok end)
    assert text =~ ~r/\| call from Elixir, with a scratch \| \d+ \(\d+\.\d\d; \d+\) \|/
    assert text =~ "Over the kernel, easy: call "
    assert File.read!(json) =~ ~s({"frame":"easy","way":"call","us":)
    broken = ["--beside", System.find_executable("false")]

    capture_io(fn ->
      assert {:error, ["--beside, easy: 1: "]} =
               Vision.Main.run(~w(--rounds 1 --frames easy) ++ broken)

      assert {:error, [line]} = Vision.Main.run(~w(--rounds 1 --frames photograph --photo no.jpg))
      assert line =~ "photograph: no.jpg is not there"
    end)

    assert capture_io(fn -> :ok = Vision.Main.run(["--help"]) end) =~ "--beside PROGRAM"
  end

  test "what cannot be measured is told in one line" do
    for {words, said} <- [
          {~w(--rounds 0), "--rounds: expected"},
          {~w(--frames easy,hard), "names of easy, speckle, photograph"},
          {~w(--beside no/such/program), "the path of a program"},
          {~w(--round 3), "did you mean --rounds?"}
        ] do
      assert {:error, [line]} = Vision.Main.run(words)
      assert line =~ said
    end

    assert {:error, line} = Vision.work(:photograph, "no.jpg")
    assert line =~ "bin/opencv-data"
    assert Beside.run({"/no/such", []}, []) |> elem(0) == :error
  end
end
