defmodule Mcap.Json do
  @moduledoc "JSON to terms, and whether a term is what a schema says: as much as these tests need."

  @doc "A JSON text; objects are lists of pairs. Raises `MatchError` for what is none."
  @spec decode!(iodata()) :: term()
  def decode!(text) do
    {value, ""} = text |> IO.iodata_to_binary() |> value()
    value
  end

  defp value("{}" <> rest), do: {{:object, []}, rest}
  defp value("{" <> rest), do: object(rest, [])
  defp value("[]" <> rest), do: {[], rest}
  defp value("[" <> rest), do: array(rest, [])
  defp value("true" <> rest), do: {true, rest}
  defp value("false" <> rest), do: {false, rest}
  defp value("null" <> rest), do: {nil, rest}
  defp value("\"" <> rest), do: string(rest, "")

  defp value(text) do
    [[number]] = Regex.scan(~r/\A-?[0-9]+(?:\.[0-9]+)?(?:[eE][+-]?[0-9]+)?/, text)
    <<_::binary-size(byte_size(number)), rest::binary>> = text

    case Integer.parse(number) do
      {integer, ""} -> {integer, rest}
      _float -> {String.to_float(number), rest}
    end
  end

  defp object(text, pairs) do
    {key, ":" <> rest} = value(text)
    {value, rest} = value(rest)

    case rest do
      "," <> rest -> object(rest, [{key, value} | pairs])
      "}" <> rest -> {{:object, Enum.reverse([{key, value} | pairs])}, rest}
    end
  end

  defp array(text, values) do
    case value(text) do
      {value, "," <> rest} -> array(rest, [value | values])
      {value, "]" <> rest} -> {Enum.reverse([value | values]), rest}
    end
  end

  defp string("\"" <> rest, text), do: {text, rest}
  defp string("\\n" <> rest, text), do: string(rest, text <> "\n")
  defp string(<<?\\, byte, rest::binary>>, text), do: string(rest, <<text::binary, byte>>)
  defp string(<<byte, rest::binary>>, text), do: string(rest, <<text::binary, byte>>)

  @doc "What is wrong with a value, by a schema: nothing may be missing, and nothing be more."
  @spec problems(term(), term(), String.t()) :: [String.t()]
  def problems(value, {:object, schema}, path \\ "") do
    case Map.new(schema) do
      %{"oneOf" => choices} ->
        known = for {:object, choice} <- choices, {"const", n} <- choice, do: n
        if value in known, do: [], else: ["#{path} is #{inspect(value)}"]

      %{"type" => "object", "properties" => {:object, fields}} ->
        object_problems(value, fields, path)

      %{"type" => "array", "items" => items} ->
        if is_list(value),
          do: Enum.flat_map(value, &problems(&1, items, path <> "[]")),
          else: ["#{path} is no list"]

      %{"contentEncoding" => "base64"} ->
        if match?({:ok, _}, Base.decode64(value)), do: [], else: ["#{path} is not base64"]

      %{"type" => type} ->
        if type?(type, value), do: [], else: ["#{path} is #{inspect(value)}, no #{type}"]
    end
  end

  defp object_problems({:object, pairs}, fields, path) do
    {keys, names} = {Enum.map(pairs, &elem(&1, 0)), Enum.map(fields, &elem(&1, 0))}

    if Enum.sort(keys) == Enum.sort(names) do
      Enum.flat_map(pairs, fn {key, value} ->
        {^key, schema} = List.keyfind(fields, key, 0)
        problems(value, schema, "#{path}.#{key}")
      end)
    else
      ["#{path} has #{inspect(keys)}, not #{inspect(names)}"]
    end
  end

  defp object_problems(value, _fields, path), do: ["#{path} is #{inspect(value)}, no object"]

  defp type?("number", value), do: is_number(value)
  defp type?("integer", value), do: is_integer(value)
  defp type?("string", value), do: is_binary(value)
  defp type?("boolean", value), do: is_boolean(value)
end
