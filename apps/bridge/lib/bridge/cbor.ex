defmodule Bridge.Cbor do
  @moduledoc """
  Writes CBOR (RFC 8949), with arrays of numbers as typed arrays (RFC 8746), as rosbridge does it. Pure.

  | Elixir | CBOR |
  |---|---|
  | integer, float, text, `nil`, boolean | the same; other atoms are text |
  | list | array |
  | map with keys of text or atoms | map, keys sorted |
  | `{:floats, list}` | tag 85, 32-bit floats, little endian; `nil` is no number |
  | `{:bytes, binary}` | tag 72, signed bytes |
  """

  @doc """
  A value.

      iex> Bridge.Cbor.encode(%{"a" => 1, b: [-1, 1.5, nil, true, "ä"]}) |> IO.iodata_to_binary() |> Base.encode16(case: :lower)
      "a26161016162852" <> "0fb3ff8000000000000f6f562c3a4"
      iex> Bridge.Cbor.encode({:floats, [1.0, nil]}) |> IO.iodata_to_binary() |> Base.encode16(case: :lower)
      "d855480000803f0000c07f"
  """
  @spec encode(term()) :: iodata()
  def encode(nil), do: <<0xF6>>
  def encode(false), do: <<0xF4>>
  def encode(true), do: <<0xF5>>
  def encode(atom) when is_atom(atom), do: atom |> Atom.to_string() |> encode()
  def encode(number) when is_integer(number) and number >= 0, do: head(0, number)
  def encode(number) when is_integer(number), do: head(1, -1 - number)
  def encode(number) when is_float(number), do: <<0xFB, number::float-64>>
  def encode(text) when is_binary(text), do: [head(3, byte_size(text)), text]
  def encode({:bytes, bytes}), do: [head(6, 72), head(2, byte_size(bytes)), bytes]

  def encode({:floats, list}) do
    bytes = for number <- list, into: <<>>, do: float(number)
    [head(6, 85), head(2, byte_size(bytes)), bytes]
  end

  def encode(list) when is_list(list), do: [head(4, length(list)), Enum.map(list, &encode/1)]

  def encode(map) when is_map(map) do
    pairs = map |> Enum.map(fn {key, value} -> {"#{key}", value} end) |> Enum.sort()
    [head(5, length(pairs)), for({key, value} <- pairs, do: [encode(key), encode(value)])]
  end

  defp float(nil), do: <<0x7FC00000::32-little>>
  defp float(number), do: <<number::float-32-little>>

  defp head(kind, number) when number < 24, do: <<kind::3, number::5>>
  defp head(kind, number) when number < 0x100, do: <<kind::3, 24::5, number::8>>
  defp head(kind, number) when number < 0x10000, do: <<kind::3, 25::5, number::16>>
  defp head(kind, number) when number < 0x100000000, do: <<kind::3, 26::5, number::32>>
  defp head(kind, number), do: <<kind::3, 27::5, number::64>>
end
