defmodule Hal.RFlex.Protocol.CommandTest do
  use ExUnit.Case, async: true
  import Bitwise
  alias Hal.RFlex.Protocol.{Command, Decoder, Packet}
  doctest Hal.RFlex
  doctest Hal.RFlex.Protocol.Command
  doctest Hal.RFlex.Protocol.Packet

  # The worked examples of the fact sheet, by their numbers there.
  @examples [
    {1, :system_reports, [100_000, 3], "1b 02 02 00 22 08 00 01 86 a0 00 00 00 03 0c 1b 03"},
    {2, :system_reports, [0, 0], "1b 02 02 00 22 08 00 00 00 00 00 00 00 00 28 1b 03"},
    {3, :input_reports, [100_000], "1b 02 05 00 00 04 00 01 86 a0 26 1b 03"},
    {4, :input_reports, [0], "1b 02 05 04 00 04 00 00 00 00 05 1b 03"},
    {5, :defaults, [], "1b 02 02 00 0a 00 08 1b 03"},
    {6, :prepare, [0, 15_693],
     "1b 02 02 00 07 0e 00 00 00 00 00 00 00 3d 4d 00 00 00 00 00 7b 1b 03"},
    {7, :prepare, [1, 2327],
     "1b 02 02 00 07 0e 01 00 00 00 00 00 00 09 17 00 00 00 00 00 14 1b 03"},
    {8, :move, [0, 15_693],
     "1b 02 02 00 07 0e 00 00 00 00 00 00 00 3d 4d 00 00 75 30 01 3f 1b 03"},
    {9, :turn, [0], "1b 02 02 00 07 0e 01 00 00 00 00 00 01 86 a0 00 00 88 b8 01 1c 1b 03"},
    {10, :move, [6277, 15_693],
     "1b 02 02 00 07 0e 00 00 00 18 85 00 00 3d 4d 00 00 75 30 01 a2 1b 03"},
    {11, :turn, [465], "1b 02 02 00 07 0e 01 00 00 01 d1 00 01 86 a0 00 00 88 b8 01 cc 1b 03"},
    {12, :turn, [-1396], "1b 02 02 00 07 0e 01 00 00 05 74 00 01 86 a0 00 00 88 b8 00 6c 1b 03"},
    {13, :move, [47_500, 9500],
     "1b 02 02 00 07 0e 00 00 00 b9 8c 00 00 25 1c 00 00 75 30 01 43 1b 03"},
    {14, :turn, [12_000], "1b 02 02 00 07 0e 01 00 00 2e e0 00 01 86 a0 00 00 88 b8 01 d2 1b 03"},
    {15, :release, [], "1b 02 02 00 0c 00 0e 1b 03"},
    {16, :brake, [], "1b 02 02 00 0b 00 09 1b 03"},
    {17, :sonar_on, [30_000, 0, 0],
     "1b 02 04 04 00 0d 00 00 75 30 00 00 00 00 00 00 00 00 02 4a 1b 03"},
    {18, :sonar_on, [30_000, 1250, 0],
     "1b 02 04 04 00 0d 00 00 75 30 00 00 04 e2 00 00 00 00 02 ac 1b 03"},
    {19, :sonar_off, [], "1b 02 04 04 00 0d 00 00 00 00 00 00 00 00 00 00 00 00 00 0d 1b 03"},
    {20, :infrared_on, [],
     "1b 02 06 00 00 15 00 00 00 00 00 00 00 46 00 00 00 0a 00 00 00 14 00 00 00 96 02 df 1b 03"},
    {21, :infrared_off, [], "1b 02 06 00 00 15 " <> String.duplicate("00 ", 21) <> "13 1b 03"},
    {22, :status, [], "1b 02 01 00 01 00 00 1b 03"},
    {23, :joystick, [], "1b 02 03 00 00 00 03 1b 03"}
  ]

  for {number, function, arguments, hex} <- @examples do
    test "worked example #{number}: #{function} #{inspect(arguments)}" do
      bytes = apply(Command, unquote(function), unquote(arguments))
      assert hex(bytes) == String.trim(unquote(hex))
    end
  end

  test "turning speeds with 1B in the second byte, as the public drivers send them" do
    for base <- [0, 0x10000, 0xA0000], low <- 0..0xFF do
      expected = if low > 127, do: base + 0x1C00, else: base + 0x1AFF
      assert speed(Command.turn(base + 0x1B00 + low)) == expected
      assert speed(Command.turn(-(base + 0x1B00 + low))) == -expected
    end
  end

  test "turning speeds with 1B in the first byte, as the public drivers send them" do
    assert Command.avoid(0x1B800001) == 0x1C800001
    assert Command.avoid(0x1B7F0001) == bor(0x7F0001, 0x1AFF0000)
  end

  test "no speed, acceleration or checksum holds a 1B, nothing grows, and little is changed" do
    :rand.seed(:exsss, {4, 2, 1})

    for n <- 1..50_000 do
      speed = if n <= 20_000, do: n, else: :rand.uniform(600_000)
      acceleration = :rand.uniform(200_000)

      for {bytes, slack} <- [
            {Command.move(speed, acceleration), 0x101},
            {Command.turn(-speed, speed), 0x101}
          ] do
        <<0x1B, 2, body::binary-19, 0x1B, 3>> = bytes
        <<_head::binary-5, sent::32, given::32, _::binary>> = body
        assert :binary.match(body, <<0x1B>>) == :nomatch, "1B in #{hex(bytes)}"
        assert sent <= speed and speed - sent < max(slack, div(speed, 100))
        assert given in [100_000, 99_999, 99_998] or (acceleration - given) in 0..0x103
      end
    end
  end

  test "nor does the first frame of an axis" do
    for axis <- [0, 1], acceleration <- Enum.concat(1..20_000, 0x1AFFF0..0x1C0010//7) do
      <<0x1B, 2, body::binary-19, 0x1B, 3>> = Command.prepare(axis, acceleration)
      assert :binary.match(body, <<0x1B>>) == :nomatch
      <<_head::binary-5, 0::32, given::32, _::binary>> = body
      assert (acceleration - given) in 0..0x10002
    end
  end

  defp speed(bytes) do
    {[%Packet{data: <<_axis, speed::32, _::64, direction>>}], _} =
      Decoder.feed(Decoder.new(), bytes)

    if direction == 1, do: speed, else: -speed
  end

  defp hex(bytes), do: bytes |> :binary.bin_to_list() |> Enum.map_join(" ", &hex_byte/1)

  defp hex_byte(byte),
    do: byte |> Integer.to_string(16) |> String.pad_leading(2, "0") |> String.downcase()
end
