defmodule Hal.Kobuki do
  @moduledoc """
  Speaks the byte protocol of the Kobuki, the base of a TurtleBot 2: packets, the command for its wheels, and what its
  reports mean in metres and radians. Pure; the line belongs to `Hal.Kobuki.Driver`.

  A packet is `AA 55`, its length, sub-payloads `id, size, data`, and the exclusive or of all from the length on. Numbers
  have their least byte first. The base reports every 20 ms, unasked.
  """
  alias Hal.Twist

  # Millimetres: the distance of the wheels.
  @base 230

  @doc """
  The packet for a speed; what exceeds 16 bits is cut off. The speed in it is that of the outer wheel, the radius that of the
  robot's centre, both in mm; radius 0 is straight on, 1 on the spot.

      iex> for {linear, turn} <- [{0, 0}, {0.1, 0}, {0, 1}, {0.2, 0.5}],
      ...>     do: Base.encode16(Hal.Kobuki.speed(Hal.Twist.new(linear, turn)))
      ["AA5506010400000000" <> "03", "AA5506010464000000" <> "67", "AA5506010473000100" <> "71", "AA5506010402019001" <> "91"]
  """
  @spec speed(Twist.t()) :: binary()
  def speed(%Twist{linear: linear, turn: turn}) do
    {speed, radius} = control(1_000 * linear, turn)
    packet(<<1, 4, word(speed)::little-signed-16, word(radius)::little-signed-16>>)
  end

  defp control(linear, turn) when abs(turn) < 1.0e-4, do: {linear, 0}

  defp control(linear, turn) do
    radius = linear / turn

    cond do
      abs(linear) < 0.1 or abs(radius) <= 1 -> {@base / 2 * turn, 1}
      radius > 0 -> {(radius + @base / 2) * turn, radius}
      true -> {(radius - @base / 2) * turn, radius}
    end
  end

  defp word(number), do: number |> round() |> max(-0x8000) |> min(0x7FFF)

  @doc "The packet that asks for the versions of hardware and firmware, and for the base's id."
  @spec ask() :: binary()
  def ask, do: packet(<<9, 2, 0x0B, 0>>)

  @doc """
  A packet with this payload.

      iex> Hal.Kobuki.packet(<<9, 2, 0x0B, 0>>)
      <<0xAA, 0x55, 4, 9, 2, 0x0B, 0, 4>>
  """
  @spec packet(payload :: binary()) :: binary()
  def packet(payload) do
    size = byte_size(payload)
    <<0xAA, 0x55, size, payload::binary, sum(<<size, payload::binary>>)>>
  end

  @doc """
  Splits a stream into the payloads of whole packets and the unfinished rest, which is shorter than a packet. After a
  packet whose sum is wrong the search goes on behind its first two bytes: these occur inside packets, too.

      iex> packet = Hal.Kobuki.packet(<<1, 2, 0xAA, 0x55>>)
      iex> Hal.Kobuki.cut(<<0xAA, 0x55, 4>> <> packet <> packet <> <<0xAA>>)
      {[<<1, 2, 0xAA, 0x55>>, <<1, 2, 0xAA, 0x55>>], <<0xAA>>}
  """
  @spec cut(binary()) :: {[payload :: binary()], rest :: binary()}
  def cut(bytes), do: cut(bytes, [])

  defp cut(bytes, found) do
    case :binary.match(bytes, <<0xAA, 0x55>>) do
      {from, 2} -> bytes |> binary_part(from, byte_size(bytes) - from) |> read(found)
      :nomatch -> {Enum.reverse(found), half(bytes)}
    end
  end

  # Shorter than 3 bytes is no payload.
  defp read(<<_start::16, size, rest::binary>>, found) when size < 3,
    do: cut(<<size, rest::binary>>, found)

  defp read(<<_start::16, size, payload::binary-size(size), sum, rest::binary>> = bytes, found) do
    if sum(<<size, payload::binary>>) == sum,
      do: cut(rest, [payload | found]),
      else: bytes |> binary_part(2, byte_size(bytes) - 2) |> cut(found)
  end

  defp read(unfinished, found), do: {Enum.reverse(found), unfinished}

  # The last byte may be half of a start.
  defp half(bytes),
    do: if(bytes != <<>> and :binary.last(bytes) == 0xAA, do: <<0xAA>>, else: <<>>)

  defp sum(bytes), do: for(<<byte <- bytes>>, reduce: 0, do: (sum -> Bitwise.bxor(sum, byte)))

  @typedoc "What one sub-payload says: the core of a report, the gyro's angle (radians), or the firmware's version."
  @type part ::
          {:core, map()}
          | {:angle, hundredths :: integer()}
          | {:firmware, {byte(), byte(), byte()}}

  @doc """
  What a payload says that a driver needs. Unknown ids are passed over; a payload in which a size is wrong is `:error`.

      iex> Hal.Kobuki.parts(<<99, 1, 7, 11, 4, 4, 1, 1, 0>>)
      {:ok, [firmware: {1, 1, 4}]}
      iex> Hal.Kobuki.parts(<<4, 6, 0::48>>)
      :error
  """
  @spec parts(payload :: binary()) :: {:ok, [part()]} | :error
  def parts(payload), do: parts(payload, [])

  defp parts(<<>>, found), do: {:ok, Enum.reverse(found)}

  defp parts(<<id, size, data::binary-size(size), rest::binary>>, found) do
    case part(id, data) do
      :error -> :error
      nil -> parts(rest, found)
      part -> parts(rest, [part | found])
    end
  end

  defp parts(_runs_past_its_end, _found), do: :error

  defp part(
         1,
         <<time::little-16, bumpers, drops, cliffs, left::little-16, right::little-16, _pwm::16,
           _buttons, charger, decivolts, overcurrent>>
       ) do
    core = %{
      time: time,
      bumpers: bumpers,
      drops: drops,
      cliffs: cliffs,
      left: left,
      right: right,
      charger: charger,
      volts: decivolts / 10,
      overcurrent: overcurrent
    }

    {:core, core}
  end

  defp part(4, <<angle::little-signed-16, _rate::16, _unused::24>>), do: {:angle, angle}
  defp part(11, <<patch, minor, major, _zero>>), do: {:firmware, {major, minor, patch}}
  # Of old firmware, whose numbers are those of a list.
  defp part(11, <<version::little-16>>), do: {:firmware, old(version)}
  defp part(id, _data) when id in [1, 4, 11], do: :error
  defp part(_unknown, _data), do: nil

  defp old(123), do: {1, 0, 0}
  defp old(version), do: {1, 1, rem(version, 10)}
end
