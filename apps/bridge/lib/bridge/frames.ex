defmodule Bridge.Frames do
  @moduledoc """
  Reads and writes the frames of a WebSocket, as a server (RFC 6455, sections 5 and 7). Pure.

  mochiweb's own reader does not say which frames are text and which bytes, answers no ping, and ends a connection whose
  frame comes in two parts of the stream.
  """
  import Bitwise

  # Longer than any request; what a client says beyond it ends its connection.
  @most_bytes 65_536

  defstruct buffer: <<>>, whole: nil

  @typedoc "The bytes that are no frame yet, and the frames of a message that is not whole."
  @type t :: %__MODULE__{
          buffer: binary(),
          whole: {:text | :binary, size :: non_neg_integer(), [binary()]} | nil
        }
  @type message ::
          {:text, String.t()} | {:binary, binary()} | {:ping, binary()} | :pong | :close

  @doc """
  What the next bytes of the stream say. The error is the status with which the connection is closed (RFC 6455, 7.4.1).

      iex> masked = <<0x81, 0x82, 1, 2, 1, 2, ?i, ?k>>
      iex> {:ok, [], frames} = Bridge.Frames.read(%Bridge.Frames{}, binary_part(masked, 0, 3))
      iex> {:ok, [{:text, "hi"}], _frames} = Bridge.Frames.read(frames, binary_part(masked, 3, 5))
      iex> Bridge.Frames.read(frames, <<>>)
      {:ok, [], frames}
  """
  @spec read(t(), binary()) :: {:ok, [message()], t()} | {:error, status :: 1002..1009}
  def read(%__MODULE__{} = frames, bytes),
    do: next(%{frames | buffer: frames.buffer <> bytes}, [])

  defp next(frames, said) do
    case frame(frames.buffer) do
      {fin, opcode, payload, rest} ->
        case message(%{frames | buffer: rest}, fin, opcode, payload) do
          {:ok, messages, frames} -> next(frames, messages ++ said)
          error -> error
        end

      :more ->
        {:ok, Enum.reverse(said), frames}

      error ->
        error
    end
  end

  defp frame(<<_fin::1, rsv::3, _::4, masked::1, _::7, _::bytes>>) when rsv != 0 or masked == 0,
    do: {:error, 1002}

  defp frame(<<fin::1, _::3, opcode::4, 1::1, 127::7, size::64, rest::bytes>>),
    do: payload(fin, opcode, size, rest)

  defp frame(<<fin::1, _::3, opcode::4, 1::1, 126::7, size::16, rest::bytes>>),
    do: payload(fin, opcode, size, rest)

  defp frame(<<fin::1, _::3, opcode::4, 1::1, size::7, rest::bytes>>) when size < 126,
    do: payload(fin, opcode, size, rest)

  defp frame(_part), do: :more

  # Control frames are short and whole.
  defp payload(fin, opcode, size, _rest) when opcode >= 8 and (fin == 0 or size > 125),
    do: {:error, 1002}

  defp payload(_fin, _opcode, size, _rest) when size > @most_bytes, do: {:error, 1009}

  defp payload(fin, opcode, size, rest) do
    case rest do
      <<mask::bytes-size(4), payload::bytes-size(size), rest::bytes>> ->
        {fin, opcode, unmask(payload, mask), rest}

      _part ->
        :more
    end
  end

  defp unmask(payload, mask) do
    size = byte_size(payload)
    :crypto.exor(payload, mask |> :binary.copy(div(size, 4) + 1) |> binary_part(0, size))
  end

  defp message(frames, _fin, 8, _payload), do: {:ok, [:close], frames}
  defp message(frames, _fin, 9, payload), do: {:ok, [{:ping, payload}], frames}
  defp message(frames, _fin, 10, _payload), do: {:ok, [:pong], frames}

  defp message(%{whole: nil} = frames, fin, opcode, payload) when opcode in [1, 2],
    do: whole(frames, fin, {if(opcode == 1, do: :text, else: :binary), 0, []}, payload)

  defp message(%{whole: {_kind, _size, _parts} = whole} = frames, fin, 0, payload),
    do: whole(frames, fin, whole, payload)

  defp message(_frames, _fin, _opcode, _payload), do: {:error, 1002}

  defp whole(frames, fin, {kind, size, parts}, payload) do
    size = size + byte_size(payload)
    parts = [payload | parts]

    cond do
      size > @most_bytes ->
        {:error, 1009}

      fin == 0 ->
        {:ok, [], %{frames | whole: {kind, size, parts}}}

      true ->
        ended(%{frames | whole: nil}, kind, parts |> Enum.reverse() |> IO.iodata_to_binary())
    end
  end

  defp ended(frames, kind, data) do
    if kind == :binary or String.valid?(data),
      do: {:ok, [{kind, data}], frames},
      else: {:error, 1007}
  end

  @doc """
  A frame to send.

      iex> Bridge.Frames.write({:text, "hi"}) |> IO.iodata_to_binary()
      <<0x81, 2, "hi">>
      iex> Bridge.Frames.write({:close, 1009}) |> IO.iodata_to_binary()
      <<0x88, 2, 1009::16>>
  """
  @spec write(
          {:text | :binary | :ping | :pong, iodata()}
          | {:close, status :: 1000..4999}
        ) :: iodata()
  def write({:close, status}), do: write(8, <<status::16>>)
  def write({:text, data}), do: write(1, data)
  def write({:binary, data}), do: write(2, data)
  def write({:ping, data}), do: write(9, data)
  def write({:pong, data}), do: write(10, data)

  defp write(opcode, data), do: [bor(0x80, opcode), size(IO.iodata_length(data)), data]

  defp size(bytes) when bytes < 126, do: bytes
  defp size(bytes) when bytes < 65_536, do: <<126, bytes::16>>
  defp size(bytes), do: <<127, bytes::64>>

  @doc "The answer to the key of a client's request (RFC 6455, 4.2.2)."
  @spec accept(key :: String.t()) :: String.t()
  def accept(key),
    do: Base.encode64(:crypto.hash(:sha, key <> "258EAFA5-E914-47DA-95CA-C5AB0DC85B11"))
end
