defmodule Hal.Json do
  @moduledoc """
  Encodes JSON; small on purpose: the reports of this project need no more, and robots need no further library.

  | Elixir | JSON |
  |---|---|
  | map (atom or string keys) | object, keys sorted, so that equal maps give equal bytes |
  | `{:object, [{key, value}]}`, non-empty keyword list | object in the order given |
  | list | array |
  | integer, float | number; a float in its shortest form that reads back the same |
  | `nil`, `true`, `false` | the same |
  | any other atom, UTF-8 string | string |
  """

  @type value ::
          nil
          | boolean()
          | number()
          | String.t()
          | atom()
          | [value()]
          | keyword(value())
          | %{optional(atom() | String.t()) => value()}
          | {:object, [{atom() | String.t(), value()}]}

  @doc """
  A value as one line of JSON. Raises `ArgumentError` for what has no JSON form: other tuples,
  pids, structs, text that is not UTF-8.

      iex> Hal.Json.encode!(%{b: [1, 2.5, nil], a: "x\\ny"})
      ~S({"a":"x\\ny","b":[1,2.5,null]})
      iex> Hal.Json.encode!({:object, [{"z", true}, {"a", 1.0e-7}]})
      ~S({"z":true,"a":1.0e-7})
      iex> Hal.Json.encode!(name: :mag1, pose: [])
      ~S({"name":"mag1","pose":[]})
  """
  @spec encode!(value()) :: String.t()
  def encode!(value), do: value |> encode() |> IO.iodata_to_binary()

  defp encode(nil), do: "null"
  defp encode(true), do: "true"
  defp encode(false), do: "false"
  defp encode(value) when is_integer(value), do: Integer.to_string(value)
  defp encode(value) when is_float(value), do: :erlang.float_to_binary(value, [:short])
  defp encode(value) when is_atom(value), do: string(Atom.to_string(value))
  defp encode(value) when is_binary(value), do: string(value)
  defp encode({:object, pairs}) when is_list(pairs), do: object(pairs)

  defp encode([{key, _value} | _rest] = pairs) when is_atom(key) and key != :object,
    do: object(pairs)

  defp encode(values) when is_list(values),
    do: [?[, Enum.map_intersperse(values, ?,, &encode/1), ?]]

  defp encode(%{} = map) when not is_struct(map),
    do: map |> Enum.sort_by(fn {key, _value} -> key_text(key) end) |> object()

  defp encode(other), do: raise(ArgumentError, "no JSON form: #{inspect(other)}")

  defp object(pairs), do: [?{, Enum.map_intersperse(pairs, ?,, &pair/1), ?}]

  defp pair({key, value}), do: [string(key_text(key)), ?:, encode(value)]

  defp key_text(key) when is_atom(key), do: Atom.to_string(key)
  defp key_text(key) when is_binary(key), do: key
  defp key_text(key), do: raise(ArgumentError, "no JSON key: #{inspect(key)}")

  defp string(text) do
    cond do
      plain?(text) ->
        [?", text, ?"]

      String.valid?(text) ->
        [?", escape(text), ?"]

      true ->
        raise(ArgumentError, "no JSON string, because it is not UTF-8: #{inspect(text)}")
    end
  end

  # Nearly all names and words: nothing of them is to be escaped.
  defp plain?(<<byte, rest::binary>>) when byte in 0x20..0x7E and byte not in [?", ?\\],
    do: plain?(rest)

  defp plain?(rest), do: rest == ""

  defp escape(text), do: for(<<byte <- text>>, do: escaped(byte))

  defp escaped(?"), do: "\\\""
  defp escaped(?\\), do: "\\\\"
  defp escaped(?\n), do: "\\n"
  defp escaped(?\r), do: "\\r"
  defp escaped(?\t), do: "\\t"

  defp escaped(byte) when byte < 0x20,
    do: "\\u" <> String.pad_leading(Integer.to_string(byte, 16), 4, "0")

  defp escaped(byte), do: byte
end
