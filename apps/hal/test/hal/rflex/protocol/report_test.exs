defmodule Hal.RFlex.Protocol.ReportTest do
  use ExUnit.Case, async: true
  alias Hal.RFlex.Protocol.{Decoder, Packet, Report}
  doctest Hal.RFlex.Protocol.Report

  # The worked examples of the fact sheet, by their numbers there.
  @examples [
    {"R1",
     "1b 02 02 07 21 19 00 00 00 00 00 00 13 88 00 ff ff 85 65 ff ff e7 7b 00 00 0c 42 00 00 75 30 d1 1b 03",
     {:axis, %{axis: 0, timestamp: 5000, position: -31_387, velocity: -6277}}},
    {"R2",
     "1b 02 02 08 21 19 00 00 00 00 00 00 13 88 01 00 00 1c 8f ff ff fa 8c 00 01 86 a0 00 00 88 b8 5a 1b 03",
     {:axis, %{axis: 1, timestamp: 5000, position: 7311, velocity: -1396}}},
    {"R3", "1b 02 04 09 02 0e 00 00 00 00 00 00 13 88 00 05 c2 10 0b 84 c2 1b 03",
     {:sonar, [{0, 1474}, {16, 2948}]}},
    {"R4",
     "1b 02 04 12 02 38 00 00 00 00 00 00 08 d1 00 05 c2 01 05 cc 02 05 d6 03 05 e0 04 05 ea 05 05 f4 06 05 fe 07 06 08 10 06 12 11 06 1c 12 06 26 13 06 30 14 06 3a 15 06 44 16 06 4e 17 06 58 56 1b 03",
     {:sonar, for(k <- 0..15, do: {if(k < 8, do: k, else: k + 8), 1474 + 10 * k})}},
    {"R5", "1b 02 05 13 01 07 00 00 08 d1 40 00 05 8c 1b 03", {:input, 0x40, 5}},
    {"R6", "1b 02 05 13 01 07 00 00 08 d1 41 00 80 08 1b 03", {:input, 0x41, 0x80}},
    {"R7",
     "1b 02 06 14 01 1b 1b 02 00 00 08 d1 64 65 66 67 68 69 6a 6b 80 00 00 08 d1 78 79 7a 7b 7c 7d 7e 7f 80 0a 1b 03",
     {:infrared,
      [<<100, 101, 102, 103, 104, 105, 106, 107>>, <<120, 121, 122, 123, 124, 125, 126, 127>>]}},
    {"R8",
     "1b 02 06 0b 01 1b 02 00 00 13 88 64 64 64 64 64 64 64 64 80 00 00 13 88 96 96 96 96 96 96 96 96 80 15 1b 03",
     {:infrared, [:binary.copy(<<100>>, 8), :binary.copy(<<150>>, 8)]}},
    {"R9", "1b 02 01 00 01 09 00 00 08 f5 00 00 09 92 00 6f 1b 03", {:status, 2450, 0}},
    {"R10", "1b 02 03 05 00 0d 00 00 13 88 ff ff ff f4 00 00 00 28 01 b2 1b 03",
     {:joystick, -12, 40, 1}},
    {"R11", "1b 02 01 0c 00 0a 00 00 13 88 11 04 01 02 04 08 86 1b 03",
     {:screen, 17, <<1, 2, 4, 8>>}}
  ]

  for {name, hex, report} <- @examples do
    test "worked example #{name}" do
      bytes = bytes(unquote(hex))
      assert {[packet], decoder} = Decoder.feed(Decoder.new(), bytes)
      assert Report.decode(packet) == unquote(Macro.escape(report))
      assert {decoder.skipped, decoder.given_up, decoder.rest} == {0, 0, <<>>}

      # Everything but the ghost of R7 comes back byte for byte.
      if unquote(name) != "R7", do: assert(Packet.encode(packet) == bytes)
    end
  end

  test "short reports are malformed, unknown ones are unknown, longer ones are read" do
    for {port, opcode} <- [{2, 33}, {4, 2}, {6, 1}, {5, 1}, {1, 1}, {3, 0}, {1, 0}] do
      packet = %Packet{port: port, opcode: opcode, data: <<2, 3>>}
      assert Report.decode(packet) == :malformed
    end

    for {port, opcode} <- [{0, 0}, {7, 1}, {255, 255}, {2, 34}, {5, 0}, {6, 0}],
        do: assert(Report.decode(%Packet{port: port, opcode: opcode}) == :unknown)

    longer = %Packet{port: 1, opcode: 1, data: <<0::32, 2450::32, 1, 77, 78>>}
    assert Report.decode(longer) == {:status, 2450, 1}
  end

  defp bytes(hex),
    do: for(byte <- String.split(hex), into: <<>>, do: <<String.to_integer(byte, 16)>>)
end
