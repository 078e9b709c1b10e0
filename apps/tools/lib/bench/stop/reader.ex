defmodule Bench.Stop.Reader do
  @moduledoc false
  # Reads the line of an rFLEX base for speeds and bumpers, and nothing else, from the fact sheet
  # alone (sections 2, 4 and 7): it shares no code with the driver or the emulated base, so that
  # their mistakes cannot hide from it. Pure.
  import Bitwise

  @type event ::
          {:speed, axis :: 0 | 1, counts :: integer()} | {:input, address :: byte(), byte()}
  @type t :: binary()

  @doc "Nothing read yet."
  @spec new() :: t()
  def new, do: <<>>

  @doc """
  Takes bytes as they come, and returns what the whole frames in them say.

      iex> frame = <<0x1B, 2, 2, 0, 7, 14, 0, 0, 0, 0x10, 0, 0::32, 0x7530::32, 1>>
      iex> sum = frame |> binary_part(2, 18) |> :binary.bin_to_list() |> Enum.reduce(&Bitwise.bxor/2)
      iex> {[], rest} = Bench.Stop.Reader.feed(Bench.Stop.Reader.new(), "noise" <> frame)
      iex> Bench.Stop.Reader.feed(rest, <<sum, 0x1B, 3>>) |> elem(0)
      [{:speed, 0, 4096}]
  """
  @spec feed(t(), binary()) :: {[event()], t()}
  def feed(rest, bytes), do: read(rest <> bytes, [])

  defp read(
         <<0x1B, 2, port, id, opcode, n, data::binary-size(n), sum, 0x1B, 3, rest::binary>> =
           bytes,
         events
       ) do
    if sum == checksum(<<port, id, opcode, n, data::binary>>),
      do: read(rest, event(port, opcode, data) ++ events),
      else: skip(bytes, events)
  end

  defp read(<<0x1B, 2, _port, _id, _opcode, n, more::binary>> = bytes, events) do
    if byte_size(more) >= n + 3,
      do: skip(bytes, events),
      else: {Enum.reverse(events), bytes}
  end

  # Perhaps the beginning of a frame.
  defp read(<<0x1B, 2, _few::binary>> = bytes, events), do: {Enum.reverse(events), bytes}
  defp read(<<0x1B>>, events), do: {Enum.reverse(events), <<0x1B>>}
  defp read(<<_byte, rest::binary>>, events), do: read(rest, events)
  defp read(<<>>, events), do: {Enum.reverse(events), <<>>}

  defp skip(<<_byte, rest::binary>>, events), do: read(rest, events)

  # Motor port, AXIS_SET_DIR: axis, velocity, acceleration, torque, direction.
  defp event(2, 7, <<axis, counts::32, _acceleration::32, _torque::32, direction>>)
       when axis in [0, 1],
       do: [{:speed, axis, if(direction == 0, do: -counts, else: counts)}]

  # Digital inputs, REPORT: time, address, two bytes of which the lower one counts.
  defp event(5, 1, <<_time::32, address, _high, low, _more::binary>>),
    do: [{:input, address, low}]

  defp event(_port, _opcode, _data), do: []

  defp checksum(bytes), do: for(<<byte <- bytes>>, reduce: 0, do: (sum -> bxor(sum, byte)))
end
