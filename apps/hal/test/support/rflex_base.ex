defmodule Hal.RFlexBase do
  @moduledoc """
  The far end of a line, as much of a controller as tests need: takes commands apart and makes reports,
  by the fact sheet and by nothing of ours.
  """
  import Bitwise

  @doc "A report's bytes."
  def report(port, opcode, data, id \\ 0) do
    body = <<port, id, opcode, byte_size(data), data::binary>>
    sum = for <<byte <- body>>, reduce: 0, do: (sum -> bxor(sum, byte))
    <<0x1B, 2, body::binary, sum, 0x1B, 3>>
  end

  @doc "One axis."
  def axis(axis, timestamp, position, velocity \\ 0) do
    report(2, 33, <<0::32, timestamp::32, axis, position::32, velocity::32, 0::32, 0::32>>)
  end

  @doc "Both axes of one moment."
  def wheels(timestamp, way, bearing, speeds \\ {0, 0}) do
    axis(0, timestamp, way, elem(speeds, 0)) <> axis(1, timestamp, bearing, elem(speeds, 1))
  end

  @doc "Sonars, as `[{id, raw}]`."
  def sonar(records),
    do: report(4, 2, <<0::64>> <> for({id, raw} <- records, into: <<>>, do: <<id, raw::16>>))

  @doc "A digital input."
  def input(address, state), do: report(5, 1, <<0::32, address, state::16>>)

  @doc "Battery and brake."
  def status(centivolts, brake), do: report(1, 1, <<0::32, centivolts::32, brake>>)

  @doc "The commands in these bytes as `{name, values}`, and the rest. What is none is passed over."
  def commands(bytes, found \\ [])

  def commands(
        <<0x1B, 2, port, id, opcode, n, data::binary-size(n), sum, 0x1B, 3, rest::binary>> =
          bytes,
        found
      ) do
    ^bytes = report(port, opcode, data, id) <> rest
    ^sum = :binary.at(bytes, 6 + n)
    commands(rest, [command(port, opcode, data) | found])
  end

  def commands(<<0x1B, 2, port, id, opcode, n, rest::binary>> = bytes, found) do
    if byte_size(rest) < n + 3,
      do: {Enum.reverse(found), bytes},
      else: commands(<<2, port, id, opcode, n, rest::binary>>, found)
  end

  def commands(bytes, found) when byte_size(bytes) < 6, do: {Enum.reverse(found), bytes}
  def commands(<<_, rest::binary>>, found), do: commands(rest, found)

  defp command(2, 7, <<0, speed::32, acceleration::32, 30_000::32, direction>>),
    do: {:move, sign(speed, direction), acceleration}

  defp command(2, 7, <<1, speed::32, acceleration::32, 35_000::32, direction>>),
    do: {:turn, sign(speed, direction), acceleration}

  defp command(2, 7, <<axis, 0::32, acceleration::32, 0::32, 0>>),
    do: {:prepare, axis, acceleration}

  defp command(2, 10, <<>>), do: :defaults
  defp command(2, 11, <<>>), do: :brake
  defp command(2, 12, <<>>), do: :release
  defp command(2, 34, <<period::32, mask::32>>), do: {:reports, period, mask}
  defp command(5, 0, <<period::32>>), do: {:inputs, period}
  defp command(4, 0, <<echo::32, ping::32, set::32, mode>>), do: {:sonar, echo, ping, set, mode}
  defp command(6, 0, <<_::160, mode>>), do: {:infrared, mode}
  defp command(1, 1, <<>>), do: :status
  defp command(3, 0, <<>>), do: :joystick

  defp sign(speed, 1), do: speed
  defp sign(speed, 0), do: -speed
end
