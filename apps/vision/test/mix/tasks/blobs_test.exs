defmodule Mix.Tasks.BlobsTest do
  use ExUnit.Case, async: false
  import ExUnit.CaptureIO
  alias Mix.Tasks.Blobs

  @moduletag if(System.find_executable("ffmpeg"), do: [], else: [skip: "ffmpeg is missing"])
  @moduletag :tmp_dir
  @source "lavfi:color=color=0xDCCD5A:size=32x24:rate=10:duration=1"

  setup %{tmp_dir: folder} do
    colours = Path.join(folder, "colours.txt")

    File.write!(
      colours,
      "[Colors]\n(255,255,0) 0.5 1 Yellow\n\n[Thresholds]\n(170:240,60:90,130:150)\n"
    )

    %{colours: colours}
  end

  test "prints a table", %{colours: colours} do
    output = capture_io(fn -> Blobs.run([@source, "--colours", colours, "--every", "5"]) end)
    assert output =~ "frame 5  0.500 s  32x24  1 blob"
    assert output =~ "2 frames, 2 blobs"
  end

  test "--json - prints nothing but objects, one a line", %{colours: colours} do
    output = capture_io(fn -> Blobs.run([@source, "--colours", colours, "--json", "-"]) end)
    lines = String.split(output, "\n", trim: true)
    assert length(lines) == 10
    assert Enum.all?(lines, &(&1 =~ ~r/^{"frame":\d.*}$/))
  end

  test "writes files", %{colours: colours, tmp_dir: folder} do
    json = Path.join(folder, "out.json")
    picture = Path.join(folder, "out.png")

    output =
      capture_io(fn ->
        Blobs.run([@source, "--colours", colours, "--json", json, "--picture", picture])
      end)

    assert output =~ "10 frames, 10 blobs, #{json} written, #{picture} written"
    assert json |> File.read!() |> String.split("\n", trim: true) |> length() == 10
    assert File.exists?(picture)
  end

  test "bad input is one line and status 1, and leaves no file behind", %{
    colours: colours,
    tmp_dir: folder
  } do
    text = Path.join(folder, "text.jpg")
    File.write!(text, "no picture")
    json = Path.join(folder, "left.json")

    for words <- [
          ["no/such.png", "--colours", colours, "--json", json],
          [text, "--colours", colours, "--json", json],
          [@source, "--colours", colours, "--json", ""],
          [@source, "--colours", "/dev/zero"],
          [@source, "--colours", folder],
          [@source, "--colours", ""],
          ["no/such.png", "--colours", colours],
          [@source, "--colours", "no/such.txt"],
          [@source, "--colours", colours, "--distance", "Red=1"],
          [@source, "--colour", colours]
        ] do
      line = capture_io(:stderr, fn -> assert catch_exit(Blobs.run(words)) == {:shutdown, 1} end)
      assert [_one] = String.split(line, "\n", trim: true)
    end

    refute File.exists?(json)
  end

  if File.exists?("/dev/full") do
    test "a report that cannot be written is not success", %{colours: colours} do
      words = [@source, "--colours", colours, "--json", "/dev/full"]
      line = capture_io(:stderr, fn -> assert catch_exit(Blobs.run(words)) == {:shutdown, 1} end)
      assert line =~ "--json /dev/full cannot be written: no space left on device"
    end
  end

  test "a source that could write files is opened only with --unsafe", context do
    %{colours: colours, tmp_dir: folder} = context
    # From here, so that the graph has no letters that ffmpeg takes for its own.
    out = folder |> Path.join("out.txt") |> Path.relative_to_cwd()
    graph = @source <> ",signalstats,metadata=print:file=" <> out
    words = [graph, "--colours", colours]
    assert refused(words) =~ "a filter graph can write files"
    refute File.exists?(out)

    assert refused(["gopher://x/1", "--colours", colours]) =~
             "gopher://x/1: expected a stream by rtsp, "

    assert capture_io(fn -> Blobs.run(words ++ ["--unsafe"]) end) =~ "10 blobs"
    assert File.exists?(out)
  end

  defp refused(words) do
    line = capture_io(:stderr, fn -> assert catch_exit(Blobs.run(words)) == {:shutdown, 1} end)
    assert String.split(line, "\n", trim: true) |> length() == 1
    line
  end

  test "--help shows examples" do
    assert capture_io(fn -> Blobs.run(["--help"]) end) =~ "mix blobs photo.jpg --colours"
  end
end
