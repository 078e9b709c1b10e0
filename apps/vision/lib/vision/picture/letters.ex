defmodule Vision.Picture.Letters do
  @moduledoc false
  # Letters of 3 by 5 dots. Each digit is a row; its bits are the dots from left to right.

  @type place :: {integer(), integer()}

  @dots Map.new(
          ~w(A25755 B65656 C34443 D65556 E74647 F74644 G34553 H55755 I72227 J11152 K55655 L44447
             M57755 N65555 O25552 P65644 Q25563 R65655 S34216 T72222 U55557 V55522 W55775 X55255
             Y55222 Z71247 075557 126227 271747 371717 455711 574717 674757 771111 875757 975717
             .00002 -00700 _00007 :02020 =07070 %51245),
          fn <<letter, rows::binary>> -> {letter, for(<<row <- rows>>, do: row - ?0)} end
        )
  # For characters that are not in it.
  @unknown [7, 5, 5, 5, 7]

  @doc "The dots of a text on a dark ground, as `{place, colour}`; the ground comes first."
  @spec strokes(String.t(), place(), 1..4, ink, ink) :: [{place(), ink}] when ink: tuple()
  def strokes(text, {left, top}, scale, ink, ground) do
    letters = text |> String.upcase() |> String.to_charlist()
    across = scale * (4 * length(letters) + 1)

    under = for x <- 0..(across - 1), y <- 0..(7 * scale - 1), do: {{left + x, top + y}, ground}

    dots =
      for {letter, column} <- Enum.with_index(letters),
          {row, y} <- Enum.with_index(rows(letter)),
          {bit, x} <- [{4, 0}, {2, 1}, {1, 2}],
          Bitwise.band(row, bit) != 0,
          dx <- 1..scale,
          dy <- 1..scale do
        {{left + scale * (4 * column + x + 1) + dx - 1, top + scale * (y + 1) + dy - 1}, ink}
      end

    under ++ dots
  end

  defp rows(?\s), do: [0, 0, 0, 0, 0]
  defp rows(letter), do: Map.get(@dots, letter, @unknown)
end
