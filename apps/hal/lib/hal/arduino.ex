defmodule Hal.Arduino do
  @moduledoc """
  Speaks the text protocol of ros_arduino_bridge, which many bases with an Arduino have: commands of a letter and numbers, ended by a
  carriage return, and one line of answer to each. Pure; the line belongs to `Hal.Arduino.Driver`.
  """

  # No answer is so long.
  @longest 64

  @typedoc "An answer: both encoders, the baud that a probe gives, that a command was done, or that it was not understood."
  @type answer :: {:encoders, integer(), integer()} | {:number, integer()} | :ok | :bad

  @doc """
  Targets of both wheels, in counts per turn of its control loop (1/30 s).

      iex> Hal.Arduino.motors(10, -10)
      "m 10 -10\\r"
  """
  @spec motors(integer(), integer()) :: binary()
  def motors(left, right), do: "m #{left} #{right}\r"

  @doc "Asks for both encoders."
  @spec encoders() :: binary()
  def encoders, do: "e\r"

  @doc "Ends whatever was half said, and asks for the baud: a probe that changes nothing."
  @spec probe() :: binary()
  def probe, do: "\rb\r"

  @doc """
  Splits a stream into answers and the line that has only begun; empty lines are left out.

      iex> Hal.Arduino.cut("OK\\r\\n-5 2147483648\\r\\n57600\\r\\n\\r\\nInvalid Command\\r\\n-5 1")
      {[:ok, :bad, {:number, 57_600}, :bad], "-5 1"}
      iex> Hal.Arduino.cut("-5 17\\r\\n")
      {[{:encoders, -5, 17}], ""}
  """
  @spec cut(binary()) :: {[answer()], rest :: binary()}
  def cut(bytes) do
    {lines, [rest]} = bytes |> :binary.split("\n", [:global]) |> Enum.split(-1)
    lines = for line <- lines, line = String.trim_trailing(line, "\r"), line != "", do: line
    # One that never ends is noise, and stays none when its end comes.
    rest = if byte_size(rest) > @longest, do: binary_part(rest, 0, @longest), else: rest
    {Enum.map(lines, &answer/1), rest}
  end

  defp answer("OK"), do: :ok
  defp answer(line) when byte_size(line) >= @longest, do: :bad

  defp answer(line) do
    case line |> :binary.split(" ", [:global]) |> Enum.map(&Integer.parse/1) do
      [{number, ""}] ->
        {:number, number}

      [{left, ""}, {right, ""}] ->
        if count?(left) and count?(right), do: {:encoders, left, right}, else: :bad

      _no_numbers ->
        :bad
    end
  end

  defp count?(number), do: number in -0x8000_0000..0x7FFF_FFFF
end
