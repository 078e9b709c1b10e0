defmodule Hal.Lds do
  @moduledoc """
  Cuts the streams of the lidars of TurtleBot3 into measurements. Pure: `Hal.Lds.Driver` owns the line.

  | lidar | a packet |
  |---|---|
  | LDS-01 (HLS-LFCD2), 230,400 baud | 42 bytes: `FA`, `A0` to `DB` for six degrees each, turns a minute in tenths, six of intensity, millimetres and two bytes that are not used, and twice 255 less the sum of the 40 bytes before |
  | LDS-02 (LD08), 115,200 baud | 47 bytes: `54 2C`, degrees a second, the first angle in 1/100 degree, twelve of millimetres and a byte of intensity, the last angle, a time, and a CRC-8 of polynomial 4D |

  Numbers are little-endian. Angles are degrees clockwise. What does not fit is dropped byte by byte.
  """
  import Bitwise

  @poly 0x4D
  # Between the first and the last angle of a packet, degrees: more than the fastest turn makes.
  @wide 45.0

  @type model :: :lds01 | :lds02
  @typedoc "The angles and ranges of a packet."
  @type packet :: [{degrees :: float(), mm :: non_neg_integer()}]

  @doc """
  The packets of these bytes, and the rest.

      iex> head = <<0xFA, 0xA1, 0, 0>> <> :binary.copy(<<0, 0, 0xE8, 3, 0, 0>>, 6)
      iex> sum = 255 - rem(Enum.sum(:binary.bin_to_list(head)), 256)
      iex> {[packet], "?"} = Hal.Lds.cut(:lds01, "noise" <> head <> <<sum, sum>> <> "?")
      iex> {length(packet), hd(packet)}
      {6, {6.0, 1000}}
  """
  @spec cut(model(), binary()) :: {[packet()], rest :: binary()}
  def cut(model, bytes), do: cut(model, bytes, [])

  defp cut(:lds01, <<0xFA, index, body::binary-size(40), rest::binary>> = bytes, done)
       when index in 0xA0..0xDB do
    <<_turns::16, six::binary-size(36), sum, sum2>> = body

    whole? =
      sum == sum2 and sum == 255 - (sum(<<0xFA, index>>, 0) + sum(body, 0) - 2 * sum &&& 255)

    if whole?,
      do: cut(:lds01, rest, [six(six, (index - 0xA0) * 6.0) | done]),
      else: skip(:lds01, bytes, done)
  end

  defp cut(:lds01, bytes, done) when byte_size(bytes) >= 42, do: skip(:lds01, bytes, done)

  defp cut(:lds02, <<0x54, 0x2C, body::binary-size(44), crc, rest::binary>> = bytes, done) do
    if crc(<<0x54, 0x2C, body::binary>>) == crc do
      <<_speed::16, first::16-little, points::binary-size(36), last::16-little, _ms::16>> = body
      cut(:lds02, rest, twelve(points, first / 100, last / 100) ++ done)
    else
      skip(:lds02, bytes, done)
    end
  end

  defp cut(:lds02, bytes, done) when byte_size(bytes) >= 47, do: skip(:lds02, bytes, done)
  defp cut(_model, rest, done), do: {Enum.reverse(done), rest}

  defp skip(model, <<_odd, rest::binary>>, done), do: cut(model, rest, done)

  defp six(six, first) do
    ranges = for <<_intensity::16, mm::16-little, _::16 <- six>>, do: mm
    for {mm, k} <- Enum.with_index(ranges), do: {first + k, mm}
  end

  defp twelve(points, first, last) do
    way = :math.fmod(last - first + 360.0, 360.0)
    ranges = for <<mm::16-little, _intensity <- points>>, do: mm

    if way <= @wide,
      do: [for({mm, k} <- Enum.with_index(ranges), do: {first + k * way / 11, mm})],
      else: []
  end

  defp sum(<<byte, rest::binary>>, sum), do: sum(rest, sum + byte)
  defp sum(<<>>, sum), do: sum

  @doc """
  The checksum of an LDS-02.

      iex> Hal.Lds.crc(<<1>>)
      0x4D
  """
  @spec crc(binary()) :: byte()
  def crc(bytes), do: for(<<byte <- bytes>>, reduce: 0, do: (crc -> shift(bxor(crc, byte), 8)))

  defp shift(crc, 0), do: crc
  defp shift(crc, n) when crc >= 128, do: shift(bxor(crc <<< 1 &&& 255, @poly), n - 1)
  defp shift(crc, n), do: shift(crc <<< 1, n - 1)
end
