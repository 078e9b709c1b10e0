defmodule Vision.PictureTest do
  use ExUnit.Case, async: true
  alias Vision.{Colours, Picture}

  setup_all do
    class = %{name: "Yellow", rgb: {255, 255, 0}, y: {170, 240}, u: {60, 90}, v: {130, 150}}
    {:ok, colours} = Colours.new([class], min_area: 4)
    grey = :binary.copy(<<100, 128>>, 40)

    rows =
      for y <- 0..29,
          into: <<>>,
          do:
            if(y in 15..24,
              do: grey <> :binary.copy(<<200, 70, 200, 140>>, 10),
              else: (grey <> grey) |> binary_part(0, 120)
            )

    {:ok, frame} = Hal.Frame.new(:yuyv, 60, 30, rows, 0)
    {:ok, blobs} = Vision.blobs(frame, colours)
    %{colours: colours, frame: frame, blobs: blobs}
  end

  defp pixel(rgb, x, y) do
    <<r, g, b>> = binary_part(rgb, 3 * (60 * y + x), 3)
    {r, g, b}
  end

  test "a box of the colour, a cross, a label; the rest stays", %{
    frame: frame,
    blobs: blobs,
    colours: colours
  } do
    assert [%{left: 40, top: 15, right: 59, bottom: 24}] = blobs
    rgb = Picture.draw(frame, blobs, colours)
    assert byte_size(rgb) == 3 * 60 * 30
    assert pixel(rgb, 40, 24) == {255, 255, 0}
    assert pixel(rgb, 39, 24) == {0, 0, 0}
    assert pixel(rgb, 50, 20) == {255, 255, 255}
    assert pixel(rgb, 10, 20) == {100, 100, 100}
    # The first dot of the Y of "Yellow".
    assert pixel(rgb, 41, 9) == {255, 255, 255}
  end

  if System.find_executable("ffmpeg") do
    @tag :tmp_dir
    test "PNG and JPEG are written, and a wrong place is one line",
         %{tmp_dir: folder} = context do
      for {name, magic} <- [{"a.png", <<0x89, "PNG">>}, {"a.jpg", <<0xFF, 0xD8>>}] do
        path = Path.join(folder, name)
        assert Picture.write(path, context.frame, context.blobs, context.colours) == :ok
        assert path |> File.read!() |> String.starts_with?(magic)
      end

      assert {:error, line} =
               Picture.write("/no/a.png", context.frame, context.blobs, context.colours)

      assert line =~ "/no/a.png"
    end
  end
end
