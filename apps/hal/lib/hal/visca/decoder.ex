defmodule Hal.Visca.Decoder do
  @moduledoc false
  # Splits the bytes of the line into replies, however they arrive (fact sheet, section 2). Pure.
  #
  # A message ends with 0xFF, which does not occur inside one; so after any damage the next message
  # is whole again. Bytes before the first header from which the rest is a reply are garbage: noise,
  # or the beginning of a message that lost its end. All bytes are accounted for: in a reply, in
  # `garbage`, in a reply of another camera of the chain (`others` counts these), or kept because
  # their 0xFF has not come. At most 15 bytes are kept, because no message is longer than 16.
  alias Hal.Visca.Reply

  @longest 15

  @enforce_keys [:camera]
  defstruct [:camera, rest: <<>>, garbage: 0, others: 0, other: nil]

  @typedoc "`garbage` counts bytes, `others` messages; `other` is the camera that sent the last of these."
  @type t :: %__MODULE__{
          camera: 1..7,
          rest: binary(),
          garbage: non_neg_integer(),
          others: non_neg_integer(),
          other: 1..7 | nil
        }

  @doc "A decoder of this camera's replies, and of broadcasts."
  @spec new(camera :: 1..7) :: t()
  def new(camera) when camera in 1..7, do: %__MODULE__{camera: camera}

  @doc """
  Takes the next bytes; returns the replies that they complete.

      iex> {[], decoder} = Hal.Visca.Decoder.feed(Hal.Visca.Decoder.new(1), <<7, 0x90, 0x4>>)
      iex> {replies, decoder} = Hal.Visca.Decoder.feed(decoder, <<0xFF, 0x90, 0x41, 0xFF, 0x90>>)
      iex> {replies, decoder.garbage, decoder.rest}
      {[{:ack, 1}], 4, <<0x90>>}
  """
  @spec feed(t(), binary()) :: {[Reply.t()], t()}
  def feed(%__MODULE__{} = decoder, bytes) when is_binary(bytes) do
    {messages, [rest]} =
      (decoder.rest <> bytes) |> :binary.split(<<0xFF>>, [:global]) |> Enum.split(-1)

    {replies, decoder} = Enum.reduce(messages, {[], decoder}, &message/2)
    {Enum.reverse(replies), keep(decoder, rest)}
  end

  defp message(bytes, {replies, decoder}) do
    decoder = keep(decoder, bytes)
    bytes = decoder.rest

    case find(bytes, 0, byte_size(bytes)) do
      {camera, reply, skipped} when camera in [0, decoder.camera] ->
        {[reply | replies], count(decoder, skipped)}

      {camera, _reply, skipped} ->
        {replies, count(%{decoder | others: decoder.others + 1, other: camera}, skipped)}

      nil ->
        {replies, count(decoder, byte_size(bytes) + 1)}
    end
  end

  # The same bytes are dropped whether they come together or one by one. Without the copy,
  # 15 bytes would keep the whole buffer that they are a part of.
  defp keep(decoder, bytes) when byte_size(bytes) <= @longest,
    do: %{decoder | rest: :binary.copy(bytes)}

  defp keep(decoder, bytes) do
    over = byte_size(bytes) - @longest
    count(%{decoder | rest: bytes |> binary_part(over, @longest) |> :binary.copy()}, over)
  end

  defp find(_bytes, size, size), do: nil

  defp find(bytes, from, size) do
    case Reply.decode(binary_part(bytes, from, size - from)) do
      {:ok, camera, reply} -> {camera, reply, from}
      :error -> find(bytes, from + 1, size)
    end
  end

  defp count(decoder, bytes), do: %{decoder | garbage: decoder.garbage + bytes}
end
