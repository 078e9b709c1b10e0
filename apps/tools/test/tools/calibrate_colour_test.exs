defmodule Tools.CalibrateColourTest do
  use ExUnit.Case, async: true
  import ExUnit.CaptureIO
  alias Tools.Calibrate.{Colour, ColourOptions}
  @moduletag :slow

  doctest Tools.Calibrate.ColourOptions
  doctest Tools.Calibrate.Plan

  @moduletag :tmp_dir
  @sim ~w(sim --box 128,80,20,60 --name YellowLandmark)

  defp run(words, typed \\ "") do
    {:ok, options} = ColourOptions.parse(words)
    me = self()
    text = capture_io(typed, fn -> send(me, {:result, Colour.run(options)}) end)
    assert_received {:result, result}
    {result, text}
  end

  test "the simulated landmark becomes a colour that finds it and nothing else", %{
    tmp_dir: folder
  } do
    {file, picture} = {Path.join(folder, "c.txt"), Path.join(folder, "look.png")}
    words = @sim ++ ["--metres", "2", "--colours", file, "--write", "--picture", picture]
    assert {:ok, text} = run(words)
    assert text =~ "inside   1200 of 1200 pixels count as YellowLandmark (100.0 %)"
    assert text =~ "all of them next to your places"
    refute text =~ "WARNING"
    assert text =~ ~r/distance: %\{"YellowLandmark" => 0\.3\d+\}/
    assert <<0x89, "PNG", _::binary>> = File.read!(picture)

    {:ok, colours} = Vision.Colours.read(file)
    [frame] = elem(Tools.Calibrate.Frames.take("sim", 1), 1)
    assert {:ok, [blob]} = Vision.blobs(frame, colours)
    assert blob.colour == "YellowLandmark"
    assert abs(blob.x - 133) < 3

    # The thesis's own limits are within those that were found.
    [%{y: {y, _}, u: {u0, u1}, v: {v0, v1}}] = colours.classes
    assert y <= 170 and u0 <= 60 and u1 >= 90 and v0 <= 130 and v1 >= 145
  end

  test "it is added to a colour file once a person agrees", %{tmp_dir: folder} do
    file = Path.join(folder, "c.txt")
    before = "# Ours.\n[Colors]\n(255,0,0) 0.5 4 Red\n\n[Thresholds]\n( 40:160, 81:125,165:255)\n"
    File.write!(file, before)

    assert {:ok, text} = run(@sim ++ ["--colours", file], "what?\nno\n")
    assert text =~ "yes or no"
    assert text =~ ~r/4 \+ \(\d+,\d+,\d+\) 0.500000 10 YellowLandmark/
    assert text =~ "not written"
    assert File.read!(file) == before

    assert {:ok, _text} = run(@sim ++ ["--colours", file], "yes\n")

    assert {:ok, %{classes: [%{name: "Red"}, %{name: "YellowLandmark"}]}} =
             Vision.Colours.read(file)

    # No answer is not a yes.
    written = File.read!(file)
    assert {:ok, text} = run(@sim ++ ["--light", "5", "--colours", file], "")
    assert text =~ "not written; --write writes it"
    assert File.read!(file) == written
  end

  test "matching background, boxes of two colours, and missing blobs are reported", %{
    tmp_dir: folder
  } do
    two = Path.join(folder, "two.ppm")

    pixels =
      for y <- 0..59,
          x <- 0..79,
          do:
            if(y in 20..39 and (x in 10..29 or x in 50..69),
              do: <<220, 205, 90>>,
              else: <<90, 90, 90>>
            )

    File.write!(two, ["P6 80 60 255\n", pixels])
    assert {:ok, text} = run([two | ~w(--box 14,24,12,12 --name Y)])

    assert text =~
             ~r/WARNING: background counts as Y: (360|38\d|400) pixels, the largest blob \(\d+\) at (59|60),30/

    assert {:ok, text} = run(~w(sim --box 90,80,70,60 --name Mixed))
    assert text =~ "of the sample have another colour and were left out"

    assert {:ok, text} = run(~w(sim --point 133,100 --name Y --min-area 100000))
    assert text =~ "no blob of at least 100000 pixels is left where you pointed"
  end

  test "without a file the lines are shown" do
    assert {:ok, text} = run(@sim)
    assert text =~ ~r/\[Colors\]\n.* YellowLandmark\n\n\[Thresholds\]\n\(/
  end

  test "wrong arguments and sources are an error of one line", %{tmp_dir: folder} do
    broken = Path.join(folder, "broken.txt")
    File.write!(broken, "[Colors]\n(255,0,0) 0.5 4 Red\n[Thresholds]\n(1:2,3:4,5:6)\n")
    assert {{:error, line}, _} = run(@sim ++ ["--colours", broken, "--write"])
    assert line =~ "broken.txt:3: the [Thresholds] header needs a blank line before it"
    assert {{:error, "no.png: no such file" <> _}, _} = run(~w(no.png --box 1,1,5,5 --name A))

    assert {{:error, "box 300,1,50,5 is not in the picture" <> _}, _} =
             run(~w(sim --box 300,1,50,5 --name A))

    for {words, line} <- [
          {~w(--box 1,1,5,5 --name A),
           "SOURCE is missing: a picture, video, stream, /dev/video0 or sim"},
          {~w(sim --name A), "--box X,Y,WIDTH,HEIGHT or --point X,Y is missing"},
          {~w(sim --point 1,1), "--name NAME is missing"},
          {~w(sim --point 1,-1 --name A),
           ~s(--point: expected X,Y in pixels from the top left, got "1,-1")},
          {~w(sim a.png --point 1,1 --name A), "expected one source, got 2: sim, a.png"},
          {~w(sim --point 1,1 --name A --light 95),
           ~s(--light: expected auto or a number from 0 to 90, got "95")},
          {~w(sim --point 1,1 --name A --picture a.gif),
           ~s(--picture: expected a name that ends in .png or .jpg, got "a.gif")},
          {~w(sim --point 1,1 --name A --write), "--write needs --colours FILE"},
          {~w(sim --point 1,1 --name A --pciture a.png),
           ~s(unknown option --pciture; did you mean --picture?)}
        ] do
      assert ColourOptions.parse(words) == {:error, [line]}
    end

    assert {:error, ["--name: expected one word of up to 60 letters, got \"a b\""]} =
             ColourOptions.parse(["sim", "--point", "1,1", "--name", "a b"])
  end
end
