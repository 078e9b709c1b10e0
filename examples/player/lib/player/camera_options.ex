defmodule Player.CameraOptions do
  @moduledoc """
  Translates the options of Player's camera drivers to ours: the head (`sonyevid30`), the picture
  (`camerav4l` and its kin) and the colours (`cmvision`). Pure.
  """
  alias Player.Units

  @doc "Translates one option of a head, a camera or a blob finder."
  @spec option(:ptz | :camera | :colours, String.t(), term(), Units.context()) :: Units.carried()
  def option(:ptz, "port", port, _context) when is_binary(port),
    do: {:ok, [{[:ptz, :port], port}]}

  def option(:ptz, "fov", {:tuple, [tele, wide]}, context)
      when is_number(tele) and is_number(wide) do
    {ends, _assumed} =
      Units.angles([tele, wide], %{context | unit_angle: context.unit_angle || :degrees})

    if tele > 0 and wide > tele,
      do: {:ok, [{[:ptz, :lens], List.to_tuple(ends)}]},
      else: {:left, "is not a pair of increasing angles"}
  end

  def option(:ptz, _name, _value, _context), do: {:left, "our driver decides this"}

  def option(:camera, "port", port, _context) when is_binary(port),
    do: {:ok, [{[:camera, :source], port}]}

  def option(:camera, "size", {:tuple, [width, height]}, _context) do
    if even?(width) and even?(height),
      do: {:ok, [{[:camera, :size], {width, height}}]},
      else: {:left, "numbers of columns and rows must be even"}
  end

  def option(:camera, "save", 0, _context), do: :used
  def option(:camera, "save", _on, _context), do: {:left, "use save_pictures: with a folder"}
  def option(:camera, "mode", _value, _context), do: {:left, "frames are always YUV here"}

  def option(:camera, "source", input, _context) when input in 0..31,
    do: {:ok, [{[:camera, :input], input}]}

  def option(:camera, "norm", norm, _context) when is_binary(norm) do
    case String.downcase(norm) do
      norm when norm in ~w(pal ntsc secam) -> {:ok, [{[:camera, :norm], norm(norm)}]}
      "unknown" -> :used
      _other -> {:left, "norms are pal, ntsc and secam"}
    end
  end

  def option(:camera, _name, _value, _context), do: {:left, "our driver decides this"}

  def option(:colours, "colorfile", file, _context) when is_binary(file),
    do: {:ok, [{[:colours, :file], file}]}

  def option(:colours, "minblobarea", area, _context) when is_integer(area) and area > 0,
    do: {:ok, [{[:colours, :min_area], area}]}

  def option(:colours, "maxblobarea", area, _context) when is_integer(area) and area >= 0,
    do: {:ok, [{[:colours, :max_area], area}]}

  def option(:colours, "debuglevel", 0, _context), do: :used
  def option(:colours, _name, _value, _context), do: {:left, "our blob finder has no such option"}

  defp norm("pal"), do: :pal
  defp norm("ntsc"), do: :ntsc
  defp norm("secam"), do: :secam

  defp even?(number), do: is_integer(number) and number in 2..32_768 and rem(number, 2) == 0
end
