defmodule Hal.ExternalTerm do
  @moduledoc """
  Decodes terms in Erlang's external format that came from outside, within a bound. Pure.

  A few bytes can make a term of many gigabytes: compressed ones by their zeros, and others because an empty list of one
  byte takes sixteen in a list. So the size of a compressed term is read from its head before anything is unpacked, and
  what a term will take in memory is counted before it is made.
  """

  # What 64-bit VMs need, in bytes.
  @word 8
  # A longer binary is kept beside the heap.
  @off_heap 9 * @word
  @compressed 80
  # Data of ours has some twenty levels. What reads it goes down them one by one.
  @most_depth 256
  # Larger numbers take long to print, and to count up to.
  @most_digits 32

  # Atoms by the width of their length's field.
  @atoms %{100 => 16, 115 => 8, 118 => 16, 119 => 8}

  @doc """
  The atom of a text from outside, if there is one: makes none.

      iex> {Hal.ExternalTerm.atom("ok"), Hal.ExternalTerm.atom("no atom was ever called so")}
      {{:ok, :ok}, :error}
  """
  @spec atom(String.t()) :: {:ok, atom()} | :error
  def atom(text) do
    {:ok, String.to_existing_atom(text)}
  rescue
    ArgumentError -> :error
  end

  @doc """
  The term, if neither its bytes, unpacked, nor its memory are more than `most` bytes. Creates no atoms, and
  takes data only: of functions those with a name that exist here, no processes, references or ports; numbers of up
  to #{@most_digits} bytes; #{@most_depth} levels.

      iex> Hal.ExternalTerm.decode(:erlang.term_to_binary({:ok, [1, 2.5]}), 100)
      {:ok, {:ok, [1, 2.5]}}
      iex> zeros = :erlang.term_to_binary(List.duplicate([], 100_000), [:compressed])
      iex> {byte_size(zeros) < 200, Hal.ExternalTerm.decode(zeros, 1_000_000)}
      {true, :error}
      iex> Hal.ExternalTerm.decode(:erlang.term_to_binary(self()), 1_000)
      :error
  """
  @spec decode(binary(), most :: pos_integer()) :: {:ok, term()} | :error
  def decode(bytes, most) do
    with {:ok, plain} <- unpacked(bytes, most), true <- within?(plain, most) do
      {:ok, :erlang.binary_to_term(<<131, plain::binary>>, [:safe])}
    else
      _no -> :error
    end
  rescue
    # An atom that is not known here, or no term.
    ArgumentError -> :error
  end

  @doc "Whether `decode/2` would decode bytes, if all atoms in them exist here. Makes nothing of them."
  @spec bounded?(binary(), most :: pos_integer()) :: boolean()
  def bounded?(bytes, most) do
    case unpacked(bytes, most) do
      {:ok, plain} -> within?(plain, most)
      :error -> false
    end
  end

  @doc "Whether a term, written without compression, is one that `decode/2` takes."
  @spec decodable?(term(), most :: pos_integer()) :: boolean()
  def decodable?(term, most) do
    <<131, plain::binary>> = :erlang.term_to_binary(term)
    byte_size(plain) <= most and within?(plain, most)
  end

  defp unpacked(<<131, @compressed, size::32, deflated::binary>>, most) when size <= most,
    do: inflate(deflated, size)

  defp unpacked(<<131, tag, _rest::binary>> = bytes, most)
       when tag != @compressed and byte_size(bytes) <= most,
       do: {:ok, binary_part(bytes, 1, byte_size(bytes) - 1)}

  defp unpacked(_other, _most), do: :error

  # No further than the head says.
  defp inflate(deflated, size) do
    z = :zlib.open()
    :ok = :zlib.inflateInit(z)
    inflate(z, :zlib.safeInflate(z, deflated), size, [])
  rescue
    _damaged in [ErlangError, ArgumentError] -> :error
  end

  defp inflate(z, {state, part}, left, parts) do
    left = left - IO.iodata_length(part)

    cond do
      left < 0 or (state == :continue and part == []) or (state == :finished and left > 0) ->
        :ok = :zlib.close(z)
        :error

      state == :finished ->
        :ok = :zlib.close(z)
        {:ok, IO.iodata_to_binary([parts | part])}

      true ->
        inflate(z, :zlib.safeInflate(z, []), left, [parts | part])
    end
  end

  # `stack` are the numbers of terms that are still to come, innermost first.
  defp within?(bytes, most), do: count(bytes, [1], 0, most)

  defp count(_bytes, _stack, _depth, left) when left < 0, do: false
  defp count(bytes, [], _depth, _left), do: bytes == <<>>
  defp count(bytes, [0 | stack], depth, left), do: count(bytes, stack, depth - 1, left)
  defp count(_bytes, _stack, depth, _left) when depth > @most_depth, do: false
  defp count(<<97, _, rest::binary>>, [n | s], d, left), do: count(rest, [n - 1 | s], d, left)
  defp count(<<98, _::32, rest::binary>>, [n | s], d, left), do: count(rest, [n - 1 | s], d, left)
  defp count(<<106, rest::binary>>, [n | s], d, left), do: count(rest, [n - 1 | s], d, left)

  defp count(<<70, _::64, rest::binary>>, [n | s], d, left),
    do: count(rest, [n - 1 | s], d, left - 2 * @word)

  defp count(<<110, size, _sign, _::binary-size(size), rest::binary>>, [n | s], d, left)
       when size <= @most_digits,
       do: count(rest, [n - 1 | s], d, left - 2 * @word - size)

  defp count(<<109, size::32, _::binary-size(size), rest::binary>>, [n | s], d, left),
    do: count(rest, [n - 1 | s], d, left - size - @off_heap)

  defp count(<<77, size::32, _bits, _::binary-size(size), rest::binary>>, [n | s], d, left),
    do: count(rest, [n - 1 | s], d, left - size - @off_heap)

  defp count(<<107, size::16, _::binary-size(size), rest::binary>>, [n | s], d, left),
    do: count(rest, [n - 1 | s], d, left - 2 * @word * size)

  for {tag, width} <- @atoms do
    defp count(
           <<unquote(tag), size::unquote(width), _::binary-size(size), rest::binary>>,
           [n | s],
           d,
           left
         ),
         do: count(rest, [n - 1 | s], d, left)
  end

  defp count(<<104, arity, rest::binary>>, [n | s], d, left),
    do: count(rest, [arity, n - 1 | s], d + 1, left - @word * (arity + 1))

  defp count(<<105, arity::32, rest::binary>>, [n | s], d, left),
    do: count(rest, [arity, n - 1 | s], d + 1, left - @word * (arity + 1))

  # A function by its name: module, function, arity.
  defp count(<<113, rest::binary>>, [n | s], d, left),
    do: count(rest, [3, n - 1 | s], d + 1, left - 8 * @word)

  # Its tail is one more term.
  defp count(<<108, length::32, rest::binary>>, [n | s], d, left),
    do: count(rest, [length + 1, n - 1 | s], d + 1, left - 2 * @word * length)

  # Keys and values, and for a large one the nodes of its tree.
  defp count(<<116, pairs::32, rest::binary>>, [n | s], d, left),
    do: count(rest, [2 * pairs, n - 1 | s], d + 1, left - @word * (4 * pairs + 5))

  defp count(_other, _stack, _depth, _left), do: false
end
