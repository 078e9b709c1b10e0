defmodule Hal.RFlex.Receiver do
  @moduledoc false
  # Turns bytes from a driver's line into readings. Time is passed in, in milliseconds.
  alias Hal.RFlex.{Driver, Readings}
  alias Hal.RFlex.Protocol.Decoder

  @idle_ms 30

  @doc "Takes bytes as they arrive."
  @spec bytes(Driver.t(), binary(), integer()) :: {[Hal.Drive.reading()], Driver.t()}
  def bytes(s, bytes, at_ms) do
    {packets, decoder} = Decoder.feed(s.decoder, bytes)
    take(packets, %{s | decoder: decoder, bytes_ms: at_ms}, at_ms)
  end

  @doc "Gives up an unfinished frame when nothing has arrived for 30 ms."
  @spec idle(Driver.t(), integer()) :: {[Hal.Drive.reading()], Driver.t()}
  def idle(s, at_ms) do
    if Decoder.waiting?(s.decoder) and at_ms - s.bytes_ms >= @idle_ms do
      {packets, decoder} = Decoder.idle(s.decoder)
      take(packets, %{s | decoder: decoder}, at_ms)
    else
      {[], s}
    end
  end

  # Noise is not a sign of a controller.
  defp take([], s, _at_ms), do: {[], s}

  defp take(packets, s, at_ms) do
    {readings, senses} = Enum.flat_map_reduce(packets, s.senses, &packet(&2, &1, at_ms))

    {readings, %{s | senses: senses, heard_ms: at_ms}}
  end

  defp packet(senses, packet, at_ms) do
    {readings, heard} = Readings.packet(senses, packet, at_ms)

    if Readings.jumps(heard) > Readings.jumps(senses),
      do: Readings.reframe(readings, heard, make_ref()),
      else: {readings, heard}
  end
end
