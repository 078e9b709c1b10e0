defmodule Sim.Stage.Colours do
  @moduledoc """
  Reads the colours of world files: X11's names, and shares of red, green and blue. Pure.

  Cameras of simulated worlds know four things by their colours (`Sim.Compute.Palette`): so all that counts of a colour is
  whether it is nearest to yellow, orange, blue or another one.
  """

  # X11's rgb.txt, without its greys and its numbered shades.
  @names """
         aliceblue f0f8ff antiquewhite faebd7 aquamarine 7fffd4 azure f0ffff beige f5f5dc bisque ffe4c4 black 000000
         blanchedalmond ffebcd blue 0000ff blueviolet 8a2be2 brown a52a2a burlywood deb887 cadetblue 5f9ea0
         chartreuse 7fff00 chocolate d2691e coral ff7f50 cornflowerblue 6495ed cornsilk fff8dc cyan 00ffff
         darkblue 00008b darkcyan 008b8b darkgoldenrod b8860b darkgray a9a9a9 darkgreen 006400 darkkhaki bdb76b
         darkmagenta 8b008b darkolivegreen 556b2f darkorange ff8c00 darkorchid 9932cc darkred 8b0000
         darksalmon e9967a darkseagreen 8fbc8f darkslateblue 483d8b darkslategray 2f4f4f darkturquoise 00ced1
         darkviolet 9400d3 deeppink ff1493 deepskyblue 00bfff dimgray 696969 dodgerblue 1e90ff firebrick b22222
         floralwhite fffaf0 forestgreen 228b22 gainsboro dcdcdc ghostwhite f8f8ff gold ffd700 goldenrod daa520
         gray bebebe green 00ff00 greenyellow adff2f honeydew f0fff0 hotpink ff69b4 indianred cd5c5c ivory fffff0
         khaki f0e68c lavender e6e6fa lavenderblush fff0f5 lawngreen 7cfc00 lemonchiffon fffacd lightblue add8e6
         lightcoral f08080 lightcyan e0ffff lightgoldenrod eedd82 lightgoldenrodyellow fafad2 lightgray d3d3d3
         lightgreen 90ee90 lightpink ffb6c1 lightsalmon ffa07a lightseagreen 20b2aa lightskyblue 87cefa
         lightslateblue 8470ff lightslategray 778899 lightsteelblue b0c4de lightyellow ffffe0 limegreen 32cd32
         linen faf0e6 magenta ff00ff maroon b03060 mediumaquamarine 66cdaa mediumblue 0000cd mediumorchid ba55d3
         mediumpurple 9370db mediumseagreen 3cb371 mediumslateblue 7b68ee mediumspringgreen 00fa9a
         mediumturquoise 48d1cc mediumvioletred c71585 midnightblue 191970 mintcream f5fffa mistyrose ffe4e1
         moccasin ffe4b5 navajowhite ffdead navy 000080 navyblue 000080 oldlace fdf5e6 olivedrab 6b8e23
         orange ffa500 orangered ff4500 orchid da70d6 palegoldenrod eee8aa palegreen 98fb98 paleturquoise afeeee
         palevioletred db7093 papayawhip ffefd5 peachpuff ffdab9 peru cd853f pink ffc0cb plum dda0dd
         powderblue b0e0e6 purple a020f0 red ff0000 rosybrown bc8f8f royalblue 4169e1 saddlebrown 8b4513
         salmon fa8072 sandybrown f4a460 seagreen 2e8b57 seashell fff5ee sienna a0522d skyblue 87ceeb
         slateblue 6a5acd slategray 708090 snow fffafa springgreen 00ff7f steelblue 4682b4 tan d2b48c
         thistle d8bfd8 tomato ff6347 turquoise 40e0d0 violet ee82ee violetred d02090 wheat f5deb3 white ffffff
         whitesmoke f5f5f5 yellow ffff00 yellowgreen 9acd32
         """
         |> String.split()
         |> Enum.chunk_every(2)
         |> Map.new(fn [name, hex] ->
           <<r, g, b>> = Base.decode16!(hex, case: :lower)
           {name, {r / 255, g / 255, b / 255}}
         end)

  @type rgb :: {red :: float(), green :: float(), blue :: float()}

  @doc """
  Red, green and blue (0 to 1) of a name, written as one likes; `nil` of one that is not known.

      iex> for name <- ["Navy Blue", "grey50", "YELLOW", "mauve"], do: Sim.Stage.Colours.named(name)
      [{0.0, 0.0, 128 / 255}, {0.5, 0.5, 0.5}, {1.0, 1.0, 0.0}, nil]
  """
  @spec named(String.t()) :: rgb() | nil
  def named(name) do
    name =
      name |> String.downcase() |> String.replace(~r/[\s_]/, "") |> String.replace("grey", "gray")

    with ["gray" <> _, percent] <- Regex.run(~r/\Agray(\d{1,3})\z/, name),
         percent when percent <= 100 <- String.to_integer(percent) do
      {percent / 100, percent / 100, percent / 100}
    else
      _other -> @names[name]
    end
  end

  @doc """
  Which of the colours that cameras know this one is.

      iex> for name <- ~w(yellow gold orange DarkOrange blue NavyBlue red LightBlue gray30),
      ...>   do: Sim.Stage.Colours.class(Sim.Stage.Colours.named(name))
      [:yellow, :yellow, :orange, :orange, :blue, :blue, :other, :other, :other]
  """
  @spec class(rgb() | nil) :: :yellow | :orange | :blue | :other
  def class({red, green, blue} = rgb) do
    {low, high} = rgb |> Tuple.to_list() |> Enum.min_max()
    strong? = high > 0.4 and (high - low) / high > 0.6

    cond do
      not strong? -> :other
      high == blue and max(red, green) <= 0.6 * blue -> :blue
      high == red and blue == low and green >= 0.8 * red -> :yellow
      high == red and blue == low and green >= 0.45 * red -> :orange
      true -> :other
    end
  end

  def class(nil), do: :other
end
