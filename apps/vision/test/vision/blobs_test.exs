defmodule Vision.BlobsTest do
  use ExUnit.Case, async: true
  @moduletag :realtime
  doctest Vision.Blobs.Options
  doctest Vision.Blobs.Report
  alias Vision.Blobs
  alias Vision.Blobs.{Options, Report}

  @moduletag if(System.find_executable("ffmpeg"), do: [], else: [skip: "ffmpeg is missing"])
  @yellow "lavfi:color=color=0xDCCD5A:size=32x24:rate=10:duration=1"

  setup_all do
    class = %{name: "Yellow", y: {170, 240}, u: {60, 90}, v: {130, 150}}
    {:ok, colours} = Vision.Colours.new([class], distance: %{"Yellow" => 0.0651})
    %{colours: colours}
  end

  defp numbers(source, colours, options) do
    me = self()
    {:ok, summary} = Blobs.run(source, colours, &send(me, {:seen, &1.number, &1.at_s}), options)
    {:messages, messages} = Process.info(self(), :messages)
    {summary, for({:seen, number, at_s} <- messages, do: {number, at_s})}
  end

  test "every n-th frame, and no more than asked for", %{colours: colours} do
    {summary, numbers} = numbers(@yellow, colours, every: 3)
    assert numbers == [{0, 0.0}, {3, 0.3}, {6, 0.6}, {9, 0.9}]
    assert %{frames: 4, blobs: 4, last: %{number: 9}} = summary
  end

  test "an endless source ends after the frames asked for", %{colours: colours} do
    {summary, numbers} = numbers("testsrc", colours, frames: 2, every: 2)
    assert Enum.map(numbers, &elem(&1, 0)) == [0, 2]
    assert summary.frames == 2
  end

  @tag :tmp_dir
  test "a file whose pictures change their size is searched to its end, and that is remarked", %{
    colours: colours,
    tmp_dir: folder
  } do
    parts =
      for size <- ["32x24", "64x36"] do
        file = Path.join(folder, "#{size}.ts")
        source = "color=color=0xDCCD5A:size=#{size}:rate=10:duration=1"
        arguments = ~w(-v error -f lavfi -i #{source} -c:v mpeg2video -bf 0 -f mpegts) ++ [file]
        {"", 0} = System.cmd("ffmpeg", arguments, stderr_to_stdout: true)
        File.read!(file)
      end

    file = Path.join(folder, "both.ts")
    File.write!(file, parts)
    assert {:ok, %{frames: frames, odd: [line]}} = Blobs.run(file, colours, fn _ -> :ok end)
    assert frames >= 15
    assert line == "its pictures are 64 x 36 now, and are scaled to the 32 x 24 of the first"
  end

  test "a report may halt the run", %{colours: colours} do
    assert Blobs.run("testsrc", colours, fn _seen -> :halt end) == :halted
  end

  test "a source that cannot be read is one line", %{colours: colours} do
    for {source, said} <- [
          {"no/such.png", "no/such.png: no such file or device"},
          {"lib", "lib: is a folder"},
          {"mix.exs", "mix.exs: not a readable picture, video or stream"},
          {"http://127.0.0.1:1/cam", "http://127.0.0.1:1/cam: not a readable"}
        ] do
      assert {:error, line} = Blobs.run(source, colours, & &1)
      assert String.starts_with?(line, said)
      refute line =~ "\n"
    end
  end

  test "a source that gives nothing is given up", %{colours: colours} do
    {:ok, listen} = :gen_tcp.listen(0, ip: {127, 0, 0, 1})
    {:ok, port} = :inet.port(listen)
    source = "http://127.0.0.1:#{port}/cam"

    assert Blobs.run(source, colours, & &1, patience_ms: 300) ==
             {:error, "#{source}: no frame for 0.3 s"}
  end

  test "the report names all fields in their order", %{colours: colours} do
    {:ok, %{last: seen}} = Blobs.run(@yellow, colours, & &1, frames: 1)

    assert Report.json(seen) ==
             ~S({"frame":0,"at_s":0.0,"width":32,"height":24,"blobs":[{"colour":"Yellow","area":768,) <>
               ~S("area_share":1.0,"x":15.5,"y":11.5,"left":0,"top":0,"right":31,"bottom":23,) <>
               ~S("distance_m":null,"clipped":true}]})

    table = IO.iodata_to_binary(Report.table(seen))
    assert table =~ "frame 0  0.000 s  32x24  1 blob\n"
    assert table =~ ~r/Yellow +768 +100.00 % +15.5 +11.5 +0,0 - 31,23 \(clipped\)/
  end

  test "wrong command lines are told in one line" do
    for {words, said} <- [
          {~w(--colours c), "no source"},
          {~w(a b --colours c), "expected one source, got 2: a, b"},
          {~w(a), "--colours FILE is missing"},
          {~w(a --colours), "--colours needs a value"},
          {~w(a --colours c --every x),
           "--every: expected a whole number from 1 to 1000000000, got \"x\""},
          {~w(a --colours c --every 0),
           "--every: expected a whole number from 1 to 1000000000, got \"0\""},
          {~w(a --colours c --frames -3),
           "--frames: expected a whole number from 1 to 1000000000, got \"-3\""},
          {~w(a --colours c --pictures p.png),
           "unknown option --pictures; did you mean --picture?"},
          {~w(a --colours c --zzz), "unknown option --zzz; known are --colours"},
          {~w(a --colours c --picture p.gif),
           "--picture: expected names ending in .png or .jpg, got \"p.gif\""},
          {~w(a --colours c --picture /no/p.png),
           "--picture: expected a file in a folder that exists, got \"/no/p.png\""},
          {~w(a --colours c --json lib), "--json: expected a file, not a folder, got \"lib\""},
          {~w(a --colours c --backend Vision.Backend.Nativ),
           "--backend: expected a module of this build"},
          {~w(a --colours c --distance Red), "--distance: expected NAME=K"},
          {~w(a --colours c --distance Red=-1),
           "--distance: expected NAME=K with K above 0, as in Yellow=0.0651, got \"Red=-1\""}
        ] do
      assert {:error, [line]} = parsed(words)
      assert String.starts_with?(line, said), line
      refute line =~ "\n"
    end
  end

  defp parsed(words) do
    with {:ok, given, sources} <- Hal.Cli.Arguments.parse_words(words, Options.table()),
         {:error, line} <- Options.check(given, sources),
         do: {:error, [line]}
  end
end
