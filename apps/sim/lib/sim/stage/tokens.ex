defmodule Sim.Stage.Tokens do
  @moduledoc """
  Splits a world file of Stage into tokens. Pure.

  A token is `{kind, {line, column}, value}`: `:word` (also `point[0]` and `property["key"]`), `:number` (always a float),
  `:text` (in `"`), `:mark` (`(`, `)`, `[`, `]`), `:end`. `#` begins a comment to the end of its line, `/*` one to the next
  `*/`; commas count as blanks. Columns count bytes.
  """

  @type at :: {line :: pos_integer(), column :: pos_integer()}
  @type token :: {:word | :number | :text | :mark | :end, at(), term()}

  @blanks [?\s, ?\t, ?\r, ?,, ?\f, ?\v]
  @marks [?(, ?), ?[, ?]]
  @longest 1_000
  @largest 1.0e9
  @number ~r/\A([-+]?)(\d{0,20})(?:\.(\d{0,40}))?(?:[eE]([-+]?\d{1,2}))?\z/
  @index ~r/\A(?:\[(?:\w{1,40}|"[^"\n\]]{1,100}")\])+/

  @doc """
  The tokens of a text, or what cannot be a token, with its place.

      iex> Sim.Stage.Tokens.cut("fov [ 3 30 ] # degrees")
      {:ok, [{:word, {1, 1}, "fov"}, {:mark, {1, 5}, "["}, {:number, {1, 7}, 3.0}, {:number, {1, 9}, 30.0}, {:mark, {1, 12}, "]"},
        {:end, {1, 23}, nil}]}
      iex> Sim.Stage.Tokens.cut("/* walls\\n */ bitmap \\"cave.png")
      {:error, {{2, 12}, "the text that begins here has no closing \\""}}
  """
  @spec cut(binary()) :: {:ok, [token()]} | {:error, {at(), String.t()}}
  def cut(text), do: cut(text, {1, byte_size(text)}, [])

  # A place is the line, and how many bytes were left where it began.
  defp at(text, {line, left}), do: {line, left - byte_size(text) + 1}

  defp cut("", place, done), do: {:ok, Enum.reverse([{:end, at("", place), nil} | done])}

  defp cut("\n" <> rest, {line, _left}, done), do: cut(rest, {line + 1, byte_size(rest)}, done)
  defp cut(<<c, rest::binary>>, place, done) when c in @blanks, do: cut(rest, place, done)
  defp cut(<<?#, rest::binary>>, place, done), do: rest |> behind("\n", 0) |> cut(place, done)

  defp cut("/*" <> rest = text, {line, left} = place, done) do
    case :binary.split(rest, "*/") do
      [comment, rest] ->
        case :binary.matches(comment, "\n") do
          [] ->
            cut(rest, place, done)

          lines ->
            {last, 1} = List.last(lines)
            after_it = byte_size(comment) - last - 1 + 2 + byte_size(rest)
            cut(rest, {line + length(lines), after_it}, done)
        end

      [_unclosed] ->
        {:error, {at(text, {line, left}), "the comment that begins here has no closing */"}}
    end
  end

  defp cut(<<c, rest::binary>> = text, place, done) when c in @marks,
    do: cut(rest, place, [{:mark, at(text, place), <<c>>} | done])

  defp cut(<<?", rest::binary>> = text, place, done) do
    with [value, rest] when byte_size(value) <= @longest <- :binary.split(rest, "\""),
         :nomatch <- :binary.match(value, "\n"),
         {:utf8, true} <- {:utf8, String.valid?(value)} do
      cut(rest, place, [{:text, at(text, place), value} | done])
    else
      {:utf8, false} ->
        {:error, {at(text, place), "the text that begins here is not UTF-8"}}

      _unclosed ->
        {:error, {at(text, place), "the text that begins here has no closing \""}}
    end
  end

  defp cut(<<c, _::binary>> = text, place, done) when c in 0x21..0x7E do
    {word, rest} = :erlang.split_binary(text, word_length(text, 0))

    cond do
      byte_size(word) > @longest ->
        {:error, {at(text, place), "#{binary_part(word, 0, 40)}… is too long a word"}}

      number_like?(word) ->
        with {:ok, number} <- number(word) do
          cut(rest, place, [{:number, at(text, place), number} | done])
        else
          :error -> {:error, {at(text, place), "#{String.slice(word, 0, 40)} is not a number"}}
        end

      true ->
        # An element of an array has its index behind its name.
        index = @index |> Regex.run(rest) |> List.wrap() |> Enum.join()
        rest = binary_part(rest, byte_size(index), byte_size(rest) - byte_size(index))
        cut(rest, place, [{:word, at(text, place), word <> index} | done])
    end
  end

  defp cut(<<c, _::binary>> = text, place, _done),
    do: {:error, {at(text, place), "byte #{c} is not allowed outside of texts and comments"}}

  defp behind(text, what, more) do
    case :binary.match(text, what) do
      {at, _} -> binary_part(text, at + more, byte_size(text) - at - more)
      :nomatch -> ""
    end
  end

  defp word_length(<<"/*", _::binary>>, n), do: n

  defp word_length(<<c, rest::binary>>, n)
       when c in 0x21..0x7E and c not in @marks and c not in [?#, ?", ?,],
       do: word_length(rest, n + 1)

  defp word_length(_rest, n), do: n

  defp number_like?(<<c, _::binary>>) when c in ?0..?9, do: true
  defp number_like?(<<c, d, _::binary>>) when c in [?-, ?+, ?.], do: d in ?0..?9 or d == ?.
  defp number_like?(_word), do: false

  # As C reads them: with a sign, and a point without digits on one side.
  defp number(word) do
    with [_, sign, whole | more] <- Regex.run(@number, word),
         [part, exponent] = Enum.take(more ++ ["", ""], 2),
         true <- whole <> part != "",
         {number, ""} <- Float.parse("#{sign}0#{whole}.#{part}0e#{zero(exponent)}"),
         true <- abs(number) <= @largest do
      {:ok, number + 0.0}
    else
      _no -> :error
    end
  end

  defp zero(""), do: "0"
  defp zero(digits), do: digits
end
