defmodule Player.Xdr do
  @moduledoc """
  Writes and reads values as Player's messages have them: XDR (RFC 4506), with the count of each array twice. Pure.

  | type | value | bytes |
  |---|---|---|
  | `:u32`, `:i32` | a whole number; Player's smaller ones and its enumerations, too | 4 |
  | `:float`, `:double` | a number | 4, 8 |
  | `:bytes` | a binary: its length, its length, itself, zeros up to a multiple of 4 | 8 and more |
  | `:opaque` | the same with its length once | 4 and more |
  | `{:list, type}` | a list: its length, its length, its elements | 8 and more |
  | `{:raw, size}` | a binary of so many bytes, whatever they are | |
  | `{:tuple, types}` | a tuple | |
  | `[field: type]` | a map | |

  What is read comes from strangers: a count is believed only if so many elements can be there, so no more memory is taken than
  the message has.
  """

  @type type ::
          :u32
          | :i32
          | :float
          | :double
          | :bytes
          | :opaque
          | {:raw, size :: pos_integer()}
          | {:list, type()}
          | {:tuple, [type()]}
          | [{atom(), type()}]

  @doc """
  A value as bytes.

      iex> Player.Xdr.encode([name: :bytes, at: {:list, :float}], %{name: "mag1", at: [1.0]})
      <<4::32, 4::32, "mag1", 1::32, 1::32, 1.0::float-32>>
      iex> Player.Xdr.encode(:bytes, "a")
      <<1::32, 1::32, "a", 0, 0, 0>>
  """
  @spec encode(type(), term()) :: binary()
  def encode(type, value), do: IO.iodata_to_binary(put(type, value))

  defp put(:u32, value), do: <<value::32>>
  defp put(:i32, value), do: <<value::signed-32>>
  defp put(:float, value), do: <<value::float-32>>
  defp put(:double, value), do: <<value::float-64>>

  defp put(:bytes, value), do: [<<byte_size(value)::32>> | put(:opaque, value)]

  defp put(:opaque, value) do
    size = byte_size(value)
    [<<size::32>>, value, :binary.copy(<<0>>, padding(size))]
  end

  defp put({:raw, size}, value) when byte_size(value) == size, do: value

  defp put({:list, type}, values) do
    count = length(values)
    [<<count::32, count::32>> | Enum.map(values, &put(type, &1))]
  end

  defp put({:tuple, types}, value),
    do: Enum.zip_with(types, Tuple.to_list(value), &put/2)

  defp put(fields, value) when is_list(fields),
    do: Enum.map(fields, fn {name, type} -> put(type, Map.fetch!(value, name)) end)

  @doc """
  The value that these bytes are, all of them.

      iex> Player.Xdr.decode([mode: :u32], <<2::32>>)
      {:ok, %{mode: 2}}
      iex> Player.Xdr.decode({:list, :float}, <<3::32, 3::32, 1.0::float-32>>)
      :error
  """
  @spec decode(type(), binary()) :: {:ok, term()} | :error
  def decode(type, bytes) do
    with {:ok, value, ""} <- take(type, bytes), do: {:ok, value}, else: (_other -> :error)
  end

  defp take(:u32, <<value::32, rest::binary>>), do: {:ok, value, rest}
  defp take(:i32, <<value::signed-32, rest::binary>>), do: {:ok, value, rest}
  # What is no number, such as infinity, does not match.
  defp take(:float, <<value::float-32, rest::binary>>), do: {:ok, value, rest}
  defp take(:double, <<value::float-64, rest::binary>>), do: {:ok, value, rest}

  defp take(:bytes, <<size::32, size::32, rest::binary>>),
    do: take(:opaque, <<size::32, rest::binary>>)

  defp take(:opaque, <<size::32, rest::binary>>) when size <= byte_size(rest) do
    padding = padding(size)

    with <<value::binary-size(size), _zeros::binary-size(padding), rest::binary>> <- rest,
         do: {:ok, value, rest},
         else: (_short -> :error)
  end

  defp take({:raw, size}, bytes) do
    with <<value::binary-size(size), rest::binary>> <- bytes,
         do: {:ok, value, rest},
         else: (_short -> :error)
  end

  defp take({:list, type}, <<count::32, count::32, rest::binary>>)
       when 4 * count <= byte_size(rest),
       do: elements(count, type, rest, [])

  defp take({:tuple, types}, bytes) do
    with {:ok, values, rest} <- each(types, bytes, []), do: {:ok, List.to_tuple(values), rest}
  end

  defp take(fields, bytes) when is_list(fields) do
    {names, types} = Enum.unzip(fields)

    with {:ok, values, rest} <- each(types, bytes, []),
         do: {:ok, names |> Enum.zip(values) |> Map.new(), rest}
  end

  defp take(_type, _bytes), do: :error

  defp elements(0, _type, rest, values), do: {:ok, Enum.reverse(values), rest}

  defp elements(count, type, bytes, values) do
    with {:ok, value, rest} <- take(type, bytes),
         do: elements(count - 1, type, rest, [value | values])
  end

  defp each([], rest, values), do: {:ok, Enum.reverse(values), rest}

  defp each([type | types], bytes, values) do
    with {:ok, value, rest} <- take(type, bytes), do: each(types, rest, [value | values])
  end

  defp padding(size), do: rem(4 - rem(size, 4), 4)
end
