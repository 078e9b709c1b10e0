defmodule Nav.MapFile.DescriptionTest do
  use ExUnit.Case, async: true
  alias Nav.MapFile.Description
  doctest Description

  @yaml """
  image: floor.pgm
  mode: trinary
  resolution: 0.050000   # metres
  origin: [-1.000000, -3.0, 0]
  negate: 0
  occupied_thresh: 0.65
  free_thresh: 0.196
  """

  defp with_line(key, line),
    do: String.replace(@yaml, ~r/^#{key}:.*$/m, line)

  test "what map_server writes is read, also with quotes, remarks, a list of lines and \\r\\n" do
    assert {:ok, %{image: "floor.pgm", resolution: 0.05, origin: {-1.0, -3.0, turn}}} =
             Description.parse(@yaml)

    assert turn == 0.0

    for yaml <- [
          String.replace(@yaml, "\n", "\r\n"),
          "# a map\n\nmaker: {name: someone}\n" <> @yaml,
          with_line("image", "image: \"floor.pgm\""),
          with_line("image", "image: 'floor.pgm'  # the picture"),
          with_line("origin", "origin:\n- -1.0\n- -3.0\n- 0.0"),
          with_line("origin", "origin: # of the corner\n  - -1.0 # left\n  - -3.0\n\n  - 0.0"),
          with_line("resolution", "resolution: 5e-2"),
          with_line("mode", "")
        ] do
      assert Description.parse(yaml) == Description.parse(@yaml)
    end
  end

  test "a quote belongs to a name only where it opens and closes it; a # in it is no remark" do
    for {written, file} <- [
          {"image: \"floor #2.pgm\" # the second", "floor #2.pgm"},
          {"image: 'a \"b\".pgm'", "a \"b\".pgm"},
          {"image: bob's floor.pgm # his", "bob's floor.pgm"},
          {"image: floor#2.pgm", "floor#2.pgm"}
        ] do
      assert {:ok, %{image: ^file}} = Description.parse(with_line("image", written))
    end

    for written <- ["image: \"floor.pgm", "image: 'floor.pgm\"", "image: ''", "image: \"a\" b"],
        do:
          assert(
            {:error, "image: expected" <> _} = Description.parse(with_line("image", written))
          )
  end

  test "what is not surely free is wall, of which what is surely occupied is known" do
    marked = fn yaml, which ->
      {:ok, description} = Description.parse(yaml)
      for grey <- 0..255, elem(Map.fetch!(description, which), grey), do: grey
    end

    walls = &marked.(&1, :shades)
    known = &marked.(&1, :known)

    assert walls.(@yaml) == Enum.to_list(0..205)
    assert walls.(with_line("free_thresh", "free_thresh: 0.25")) == Enum.to_list(0..191) ++ [205]
    assert walls.(with_line("free_thresh", "")) == Enum.to_list(0..205)
    assert walls.(with_line("negate", "negate: 1")) == Enum.to_list(50..255)
    assert walls.(with_line("mode", "mode: scale")) == Enum.to_list(0..205)
    # The shares themselves, in per cent; above 100 it is unknown.
    assert walls.(with_line("mode", "mode: raw")) == Enum.to_list(20..255)

    assert known.(@yaml) == Enum.to_list(0..89)
    assert known.(with_line("negate", "negate: 1")) == Enum.to_list(166..255)
    assert known.(with_line("mode", "mode: raw")) == Enum.to_list(65..100)
  end

  test "an origin may be turned, and what is transparent gets a shade that is wall" do
    for {turn, read} <- [{"3.14", 3.14}, {"-1.5708", -1.5708}, {"-0.0", 0.0}] do
      assert {:ok, %{origin: {25.9, 48.5, ^read}}} =
               Description.parse(with_line("origin", "origin: [25.9, 48.5, #{turn}]"))
    end

    for {key, line} <- [
          {"mode", ""},
          {"negate", "negate: 1"},
          {"mode", "mode: raw"},
          {"mode", "mode: scale"}
        ] do
      assert {:ok, %{shades: shades, transparent: shade}} =
               Description.parse(with_line(key, line))

      assert elem(shades, shade)
    end
  end

  test "each mistake is one line that says what is allowed" do
    for {yaml, pattern} <- [
          {"", ~r/^image is missing; needed are image, resolution, origin$/},
          {<<0xFF, 0xFE>>, ~r/^is not text$/},
          {with_line("image", "image:"), ~r/^image: expected the name/},
          {with_line("resolution", "resolution: fine"), ~r/^resolution: expected a number/},
          {with_line("resolution", "resolution: 0"),
           ~r/^resolution: expected a number from 0.001/},
          {with_line("resolution", "resolution: 1e99"), ~r/^resolution: expected .*, got 1e99/},
          {with_line("resolution", "resolution: 1e-99"), ~r/^resolution: expected .*, got 1e-99/},
          {with_line("origin", "origin: 3"),
           ~r/^origin: expected \[x, y, turn\] in metres and radians/},
          {with_line("origin", "origin: [1.0]"), ~r/^origin: expected/},
          {with_line("origin", "origin: [a, b, c]"), ~r/^origin: expected/},
          {with_line("origin", "origin: [0, 0, 90]"),
           ~r/^origin: expected .* radians, got \[0, 0, 90\]/},
          {with_line("origin", "origin: [0, 0, .nan]"), ~r/^origin: expected/},
          {with_line("free_thresh", "free_thresh: 0.0"),
           ~r/^free_thresh: 0 leaves no floor: this is a mask/},
          {with_line("occupied_thresh", "occupied_thresh: 7"),
           ~r/^occupied_thresh: expected .*, got 7/},
          {with_line("negate", "negate: 2"), ~r/^negate: expected 0 or 1/},
          {with_line("mode", "mode: costs"),
           ~r/^mode: expected trinary, scale or raw, got costs/},
          {String.replace(with_line("mode", "mode: raw"), "negate: 0", "negate: 1"),
           ~r/^mode: raw with negate: 1 means one thing in ROS 1/},
          {@yaml <> "resolution: 0.1\n", ~r/^resolution is given twice$/},
          {@yaml <> "origin:\n- 0\n- 0\n", ~r/^origin is given twice$/},
          {with_line("origin", "origin:\n- -1.0 -3.0\n- 0.0"), ~r/^origin: expected/},
          {with_line("origin", "origin:"), ~r/^origin: expected .*, got \[\]/}
        ] do
      assert {:error, line} = Description.parse(yaml)
      assert line =~ pattern
      refute line =~ "\n"
    end
  end
end
