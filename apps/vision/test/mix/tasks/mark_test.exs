defmodule Mix.Tasks.MarkTest do
  use ExUnit.Case, async: false
  import ExUnit.CaptureIO
  alias Vision.Marks

  @moduletag :tmp_dir
  @moduletag skip: with({:error, line} <- Marks.available(), do: line, else: (:ok -> false))

  defp mark(words), do: capture_io(fn -> Mix.Tasks.Mark.run(words) end)

  test "the drawing has the size that is asked for, and the cells of the library", context do
    file = Path.join(context.tmp_dir, "mark.svg")

    assert mark(["7", "--svg", file]) =~
             "tag36h11 7, 160.0 mm between its corners: #{file} written"

    svg = File.read!(file)
    assert svg =~ ~s(width="240mm" height="246mm")
    {10, 8, picture} = Marks.Native.picture(:tag36h11, 7)
    assert painted(svg, 10, 20.0) == picture
    mark(["7", "--svg", file])
    assert File.read!(file) == svg

    mark(["2114", "--svg", file, "--family", "tagStandard41h12", "--size", "0.05"])
    {9, 5, picture} = Marks.Native.picture(:tagStandard41h12, 2114)
    assert painted(File.read!(file), 9, 10.0) == picture
  end

  test "what is wrong is one line and status 1", context do
    file = Path.join(context.tmp_dir, "mark.svg")

    for {words, line} <- [
          {["587", "--svg", file], "mark: tag36h11 has no mark 587"},
          {["seven", "--svg", file], "mark: expected the number of a mark, got seven"},
          {["--svg", file], "mark: expected the number of one mark"},
          {["7"], "mark: --svg FILE is missing"},
          {["7", "--svg", file, "--family", "tag36h12"], "did you mean tag36h11?"},
          {["7", "--svg", file, "--size", "0"], "a number from 0.01 to 10"},
          {["7", "--svg", context.tmp_dir], "cannot be written: "}
        ] do
      error = capture_io(:stderr, fn -> assert catch_exit(mark(words)) == {:shutdown, 1} end)

      assert error =~ line
      assert length(String.split(error, "\n", trim: true)) == 1
    end
  end

  # The cells of a drawing, by its black rectangles.
  defp painted(svg, cells, cell) do
    black =
      for [_, x, y, width] <-
            Regex.scan(~r/<rect x="([\d.]+)" y="([\d.]+)" width="([\d.]+)"/, svg),
          [x, y, width] = Enum.map([x, y, width], &(&1 |> Float.parse() |> elem(0))),
          n <- 0..(round(width / cell) - 1),
          into: MapSet.new(),
          do: {round(x / cell) - 1 + n, round(y / cell) - 1}

    for row <- 0..(cells - 1), column <- 0..(cells - 1), into: <<>> do
      if MapSet.member?(black, {column, row}), do: <<0>>, else: <<1>>
    end
  end
end
