defmodule Hal.Create do
  @moduledoc """
  Speaks the Open Interface of an iRobot Create 2 and of Roombas 600 to 800: commands, and the stream of what their sensors say. Pure; the
  line belongs to `Hal.Create.Driver`.

  Commands are an opcode and a fixed number of bytes, without frame or sum. A frame of the stream is 13 (hexadecimal), its length, `id, data` of each
  packet, and a byte that makes the sum of all 0. Numbers have their greatest byte first.
  """
  import Bitwise
  alias Hal.Twist

  @wheel_base 0.235
  # The most that a wheel does, mm/s.
  @most 500

  # Packets of the stream, in the order in which they are asked for and come, with their sizes.
  @packets [
    bumps_drops: {7, 1},
    cliff_left: {9, 1},
    cliff_front_left: {10, 1},
    cliff_front_right: {11, 1},
    cliff_right: {12, 1},
    overcurrent: {14, 1},
    millivolts: {22, 2},
    charger: {34, 1},
    mode: {35, 1},
    left: {43, 2},
    right: {44, 2}
  ]
  @ids for {_name, {id, _size}} <- @packets, do: id
  @length Enum.sum(for {_name, {_id, size}} <- @packets, do: size + 1)

  @typedoc "What a frame says, by the names of its packets: whole numbers without a sign."
  @type report :: %{atom() => non_neg_integer()}

  @doc "Wakes the interface; the wheels have no power until `safe/0`."
  @spec start() :: binary()
  def start, do: <<128>>

  @doc "Gives the wheels power until there is a cliff, a wheel in the air or a charger."
  @spec safe() :: binary()
  def safe, do: <<131>>

  @doc """
  Asks for a frame every 15 ms.

      iex> Base.encode16(Hal.Create.stream())
      "940B07090A0B0C0E1622232B2C"
  """
  @spec stream() :: binary()
  def stream, do: IO.iodata_to_binary([148, length(@ids), @ids])

  @doc """
  A speed; where a wheel would be faster than 0.5 m/s, both are slower, in the same proportion.

      iex> for {linear, turn} <- [{0.2, 0}, {0, 0.1 / 0.1175}, {0.5, 2.0}], do: Base.encode16(Hal.Create.speed(Hal.Twist.new(linear, turn)))
      ["9100C800C8", "910064FF9C", "9101F400B4"]
  """
  @spec speed(Twist.t()) :: binary()
  def speed(%Twist{linear: linear, turn: turn}) do
    right = 1_000 * (linear + turn * @wheel_base / 2)
    left = 1_000 * (linear - turn * @wheel_base / 2)
    share = min(1.0, @most / max(max(abs(left), abs(right)), 1.0))
    <<145, round(right * share)::signed-16, round(left * share)::signed-16>>
  end

  @doc """
  A stop, and the wheels without power. It is long enough that the rest of any command that was cut off cannot swallow it.
  """
  @spec stop() :: binary()
  def stop, do: :binary.copy(speed(Twist.zero()) <> start(), 2)

  @doc """
  Splits a stream into what its whole frames say and the unfinished rest. Whatever is no frame, such as text that the robot prints
  when it starts, is passed over.

      iex> {[report], ""} = Hal.Create.cut(Hal.Create.frame(%{mode: 2, left: 65_000, millivolts: 14_500}))
      iex> {report.mode, report.left, report.right, report.millivolts}
      {2, 65_000, 0, 14_500}
  """
  @spec cut(binary()) :: {[report()], rest :: binary()}
  def cut(bytes), do: cut(bytes, [])

  defp cut(<<0x13, @length, body::binary-size(@length), sum, later::binary>> = bytes, found) do
    with 0 <- sum(<<0x13, @length, body::binary, sum>>),
         {:ok, report} <- packets(@packets, body, %{}) do
      cut(later, [report | found])
    else
      _no_frame -> skip(bytes, found)
    end
  end

  defp cut(<<0x13, @length, rest::binary>> = begun, found) when byte_size(rest) <= @length,
    do: {Enum.reverse(found), begun}

  defp cut(<<0x13>>, found), do: {Enum.reverse(found), <<0x13>>}
  defp cut(<<>>, found), do: {Enum.reverse(found), <<>>}
  defp cut(bytes, found), do: skip(bytes, found)

  defp skip(<<_first, rest::binary>>, found), do: cut(rest, found)

  defp packets([], <<>>, report), do: {:ok, report}

  defp packets([{name, {id, size}} | others], body, report) do
    case body do
      <<^id, number::size(size)-unit(8), rest::binary>> ->
        packets(others, rest, Map.put(report, name, number))

      _another ->
        :error
    end
  end

  @doc "The bytes of a frame that says this, and 0 of all else."
  @spec frame(report()) :: binary()
  def frame(report) do
    body =
      for {name, {id, size}} <- @packets, into: <<>> do
        <<id, Map.get(report, name, 0)::size(size)-unit(8)>>
      end

    <<0x13, @length, body::binary, -sum(<<0x13, @length, body::binary>>)::8>>
  end

  defp sum(bytes), do: for(<<byte <- bytes>>, reduce: 0, do: (sum -> sum + byte &&& 0xFF))
end
