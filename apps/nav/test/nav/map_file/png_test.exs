defmodule Nav.MapFile.PngTest do
  use ExUnit.Case, async: true
  alias Nav.MapFile
  doctest MapFile.Pgm
  @moduletag :tmp_dir

  # A test picture of ffmpeg's, as it writes it.
  defp picture(dir, {width, height}, format, options, name \\ "a.png") do
    file = Path.join(dir, name)
    source = "testsrc2=size=64x64,format=rgb24,crop=#{width}:#{height}:8:8"

    arguments =
      ~w(-v error -y -f lavfi -i #{source} -frames:v 1 -update 1 -pix_fmt #{format}) ++
        options ++ [file]

    {"", 0} = System.cmd("ffmpeg", arguments, stderr_to_stdout: true)
    assert {:ok, {^width, ^height, rows} = picture} = MapFile.picture(file, 10_000)
    assert Enum.all?(rows, &(byte_size(&1) == width))
    picture
  end

  test "an interlaced picture is the same one, of whatever size and kind", %{tmp_dir: dir} do
    for size <- [{1, 1}, {2, 3}, {3, 1}, {5, 5}, {8, 9}, {37, 23}],
        do: assert(laced(dir, size, "gray") == picture(dir, size, "gray", []))

    for format <- ~w(rgb24 rgba ya8 gray16be rgb48be rgba64be pal8 monob),
        do: assert(laced(dir, {37, 23}, format) == picture(dir, {37, 23}, format, []))
  end

  defp laced(dir, size, format) do
    picture = picture(dir, size, format, ~w(-flags +ildct), "laced.png")
    assert <<_::binary-size(28), 1, _::binary>> = File.read!(Path.join(dir, "laced.png"))
    picture
  end

  test "of 16 bits the upper eight are read, in PNG and PGM", %{tmp_dir: dir} do
    for {deep, flat} <- [{"gray16be", "gray"}, {"rgb48be", "rgb24"}, {"rgba64be", "rgba"}] do
      for options <- [[], ~w(-pred mixed)] do
        {_, _, rows} = picture(dir, {37, 23}, deep, options)
        {_, _, plain} = picture(dir, {37, 23}, flat, options)

        pairs =
          Enum.zip(
            Enum.flat_map(rows, &:binary.bin_to_list/1),
            Enum.flat_map(plain, &:binary.bin_to_list/1)
          )

        assert Enum.all?(pairs, fn {a, b} -> abs(a - b) <= 1 end), deep
      end
    end

    {_, _, rows} = picture(dir, {37, 23}, "gray16be", [], "a.pgm")
    {_, _, plain} = picture(dir, {37, 23}, "gray", [], "a.pgm")

    pairs =
      Enum.zip(
        Enum.flat_map(rows, &:binary.bin_to_list/1),
        Enum.flat_map(plain, &:binary.bin_to_list/1)
      )

    assert Enum.all?(pairs, fn {a, b} -> abs(a - b) <= 1 end)
  end
end
