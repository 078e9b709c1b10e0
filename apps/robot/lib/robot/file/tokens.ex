defmodule Robot.File.Tokens do
  @moduledoc """
  Cuts the text of a robot file into tokens. Pure. Elixir's own reader is not used: it makes names
  into atoms, and with names left as text it falls over its own messages.

  A token is `{kind, line, value}`:

  | kind | value |
  |---|---|
  | `:number`, `:text` | the number, the text |
  | `:name` | `"mag1"` of `:mag1` |
  | `:key` | `"id"` of `id:` |
  | `:word` | `true`, `nil`, `deg` and what else begins with a small letter |
  | `:module` | `"Some.Module"` |
  | `:mark` | one of `[ ] { } ( ) %{ => , - +` |
  | `:end` | `nil`; the last token |
  """

  @marks ["[", "]", "{", "}", "(", ")", ",", "-", "+"]
  @escapes %{?" => ?", ?\\ => ?\\, ?# => ?#, ?n => ?\n, ?t => ?\t}
  @longest 255

  @type token :: {kind :: atom(), line :: pos_integer(), value :: term()}

  @doc """
  The tokens of a text, or the line that holds something else.

      iex> Robot.File.Tokens.cut("[id: :mag1] # its name")
      {:ok, [{:mark, 1, "["}, {:key, 1, "id"}, {:name, 1, "mag1"}, {:mark, 1, "]"}, {:end, 1, nil}]}
      iex> Robot.File.Tokens.cut("[a: 1,\\n b: 0x]")
      {:error, {2, "0x is not a number"}}
  """
  @spec cut(String.t()) :: {:ok, [token()]} | {:error, {pos_integer(), String.t()}}
  def cut(text), do: cut(text, 1, [])

  defp cut("", line, tokens), do: {:ok, Enum.reverse([{:end, line, nil} | tokens])}
  defp cut("\n" <> rest, line, tokens), do: cut(rest, line + 1, tokens)
  defp cut(<<c, rest::binary>>, line, tokens) when c in ~c" \t\r", do: cut(rest, line, tokens)

  defp cut("#" <> _ = text, line, tokens) do
    case :binary.split(text, "\n") do
      [_comment, rest] -> cut(rest, line + 1, tokens)
      [_comment] -> cut("", line, tokens)
    end
  end

  defp cut("%{" <> rest, line, tokens), do: cut(rest, line, [{:mark, line, "%{"} | tokens])
  defp cut("=>" <> rest, line, tokens), do: cut(rest, line, [{:mark, line, "=>"} | tokens])

  defp cut(<<mark::binary-size(1), rest::binary>>, line, tokens) when mark in @marks,
    do: cut(rest, line, [{:mark, line, mark} | tokens])

  defp cut(<<?", rest::binary>>, line, tokens), do: text(rest, line, line, [], tokens)

  defp cut(<<?:, c, _::binary>> = text, line, tokens) when c in ?a..?z or c == ?_ do
    <<?:, rest::binary>> = text
    {name, rest} = name(rest)
    add(rest, line, {:name, line, name}, tokens)
  end

  defp cut(<<c, _::binary>> = text, line, tokens) when c in ?0..?9, do: number(text, line, tokens)

  defp cut(<<c, _::binary>> = text, line, tokens) when c in ?a..?z or c == ?_ do
    {name, rest} = name(text)

    case rest do
      # A key's colon ends the word, unlike that of ::.
      <<?:, after_colon, _::binary>> when after_colon in ~c( \t\r\n["{:-0123456789%) ->
        key(rest, line, name, tokens)

      _word ->
        add(rest, line, {:word, line, name}, tokens)
    end
  end

  defp cut(<<c, _::binary>> = text, line, tokens) when c in ?A..?Z do
    name = head(~r/^[A-Z][A-Za-z0-9_]*(\.[A-Z][A-Za-z0-9_]*)*/, text)
    add(rest(text, name), line, {:module, line, name}, tokens)
  end

  defp cut(text, line, _tokens) do
    what = text |> String.first() |> inspect()

    {:error,
     {line, "#{what} cannot be here: a robot file holds values only, it is read and not run"}}
  end

  defp key(":" <> rest, line, name, tokens) do
    case rest do
      <<c, _::binary>> when c in ~c" \t\r\n" -> add(rest, line, {:key, line, name}, tokens)
      _other -> {:error, {line, "a space is missing after #{shorten(name)}:"}}
    end
  end

  defp add(rest, line, {_kind, _line, name} = token, tokens) do
    if byte_size(name) <= @longest,
      do: cut(rest, line, [token | tokens]),
      else: {:error, {line, "no name is as long as #{shorten(name)}"}}
  end

  defp name(text) do
    name = head(~r/^[A-Za-z0-9_@]+[?!]?/, text)
    {name, rest(text, name)}
  end

  defp head(pattern, text), do: pattern |> Regex.run(text, capture: :first) |> hd()

  defp rest(text, head), do: binary_part(text, byte_size(head), byte_size(text) - byte_size(head))

  # All that can belong to a number is taken first, so that 1.5m is no number and not two things.
  defp number(text, line, tokens) do
    word = head(~r/^[0-9A-Za-z_]+(\.[0-9][0-9A-Za-z_]*([-+][0-9]+)?)?/, text)

    with false <- byte_size(word) > 40 or word =~ ~r/__|_$|_\./,
         {:ok, number} <- value(String.replace(word, "_", "")) do
      cut(rest(text, word), line, [{:number, line, number} | tokens])
    else
      _no -> {:error, {line, "#{shorten(word)} is not a number"}}
    end
  end

  defp value("0x" <> digits), do: integer(digits, 16)

  defp value(word) do
    if word =~ ~r/^[0-9]+$/, do: integer(word, 10), else: float(word)
  end

  defp integer(digits, base) do
    case Integer.parse(digits, base) do
      {number, ""} -> {:ok, number}
      _no -> :error
    end
  end

  # Too large for a float is an error of Float.parse/1 in some versions, and an exception in others.
  defp float(word) do
    with true <- word =~ ~r/^[0-9]+\.[0-9]+([eE][-+]?[0-9]{1,2})?$/,
         {number, ""} <- Float.parse(word) do
      {:ok, number}
    else
      _no -> :error
    end
  end

  defp text("", first, _line, _done, _tokens),
    do: {:error, {first, "the text that begins here has no closing \""}}

  defp text(<<?", rest::binary>>, first, line, done, tokens) do
    text = done |> Enum.reverse() |> List.to_string()
    cut(rest, line, [{:text, first, text} | tokens])
  end

  defp text(<<?\\, c, rest::binary>>, first, line, done, tokens) when is_map_key(@escapes, c),
    do: text(rest, first, line, [@escapes[c] | done], tokens)

  defp text(<<?\\, _::binary>>, _first, line, _done, _tokens),
    do: {:error, {line, ~S(in text, only \" \\ \# \n \t may follow a \\)}}

  defp text(<<?#, ?{, _::binary>>, _first, line, _done, _tokens),
    do: {:error, {line, "nothing is put into text: \#{…} cannot be here"}}

  defp text(<<?\n, rest::binary>>, first, line, done, tokens),
    do: text(rest, first, line + 1, [?\n | done], tokens)

  defp text(<<c::utf8, rest::binary>>, first, line, done, tokens),
    do: text(rest, first, line, [c | done], tokens)

  defp shorten(word),
    do: if(byte_size(word) > 40, do: binary_part(word, 0, 37) <> "…", else: word)
end
