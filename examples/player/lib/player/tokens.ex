defmodule Player.Tokens do
  @moduledoc """
  Splits a configuration file of the Player device server into tokens. Pure.

  A token is `{kind, line, value}`: `:word` (also `position:0`), `:number`, `:text` (in `"`),
  `:mark` (`(`, `)`, `[`, `]`), `:end`. `#` begins a comment; commas count as blanks. A number is what Player reads as one: a sign,
  digits and a point. Lines end as Player's do, in LF, CR, or both.
  """

  @type token :: {:word | :number | :text | :mark | :end, line :: pos_integer(), term()}

  @blanks [?\s, ?\t, ?\r, ?,, ?\f, ?\v]
  @marks [?(, ?), ?[, ?]]
  @longest 1_000
  @largest 1.0e12

  @doc """
  The tokens of a file, or what cannot be a token, with its line.

      iex> Player.Tokens.cut("fov [ 3 30 ] # degrees")
      {:ok, [{:word, 1, "fov"}, {:mark, 1, "["}, {:number, 1, 3}, {:number, 1, 30}, {:mark, 1, "]"}, {:end, 1, nil}]}
      iex> Player.Tokens.cut("port\\n  \\"/dev/ttyS1")
      {:error, {2, "the text that begins here has no closing \\""}}
  """
  @spec cut(String.t()) :: {:ok, [token()]} | {:error, {pos_integer(), String.t()}}
  def cut(text), do: text |> String.replace(["\r\n", "\n\r", "\r"], "\n") |> cut(1, [])

  defp cut("", line, done), do: {:ok, Enum.reverse([{:end, line, nil} | done])}
  defp cut("\n" <> rest, line, done), do: cut(rest, line + 1, done)
  defp cut(<<c, rest::binary>>, line, done) when c in @blanks, do: cut(rest, line, done)
  defp cut(<<?#, rest::binary>>, line, done), do: cut(after_line(rest), line, done)

  defp cut(<<c, rest::binary>>, line, done) when c in @marks,
    do: cut(rest, line, [{:mark, line, <<c>>} | done])

  defp cut(<<?", rest::binary>>, line, done) do
    case :binary.split(rest, "\"") do
      [text, rest] when byte_size(text) <= @longest ->
        more = length(:binary.matches(text, "\n"))
        if more == 0, do: cut(rest, line, [{:text, line, text} | done]), else: unclosed(line)

      _none_or_far_away ->
        unclosed(line)
    end
  end

  defp cut(<<c, _::binary>> = text, line, done) when c in 0x21..0x7E do
    length = word_length(text, 0)
    {word, rest} = :erlang.split_binary(text, length)

    cond do
      length > @longest -> {:error, {line, "#{binary_part(word, 0, 40)}… is too long a word"}}
      number_like?(word) -> number(word, rest, line, done)
      true -> indexed(word, rest, line, done)
    end
  end

  defp cut(<<c, _::binary>>, line, _done),
    do: {:error, {line, "byte #{c} is not allowed in a configuration file"}}

  defp unclosed(line), do: {:error, {line, "the text that begins here has no closing \""}}

  defp after_line(text) do
    case :binary.match(text, "\n") do
      {at, 1} -> binary_part(text, at, byte_size(text) - at)
      :nomatch -> ""
    end
  end

  defp word_length(<<c, rest::binary>>, n)
       when c in 0x21..0x7E and c not in @marks and c not in [?#, ?", ?,],
       do: word_length(rest, n + 1)

  defp word_length(_rest, n), do: n

  # An element of an array has its index behind its name, as in pose[0].
  defp indexed(word, rest, line, done) do
    index =
      case Regex.run(~r/^(?:\[\d{1,6}\][\w.]*)+/, rest) do
        [index] when byte_size(index) <= @longest -> index
        _none -> ""
      end

    rest = binary_part(rest, byte_size(index), byte_size(rest) - byte_size(index))
    cut(rest, line, [{:word, line, word <> index} | done])
  end

  defp number_like?(<<c, _::binary>>) when c in ?0..?9, do: true

  defp number_like?(<<sign, c, _::binary>>) when sign in ~c"+-." and c in ~c"0123456789.",
    do: true

  defp number_like?(_word), do: false

  defp number(word, rest, line, done) do
    case parse(word) do
      {:ok, number} when abs(number) <= @largest ->
        cut(rest, line, [{:number, line, number} | done])

      _no ->
        shown = binary_part(word, 0, min(byte_size(word), 40))
        {:error, {line, "#{shown} is not a number: Player reads a sign, digits and a point"}}
    end
  end

  # As C reads them: with a sign, leading zeros, and a point without digits on one side. Player's own reader stops at another
  # character, so it takes 1e-3 for 1, and 0x31 for 0.
  defp parse(word) do
    case Regex.run(~r/^([-+]?)(\d*)(?:\.(\d*))?$/, word) do
      [_, _sign, ""] ->
        :error

      [_, sign, whole] when byte_size(whole) <= 20 ->
        {:ok, signed(sign, String.to_integer(whole))}

      [_, sign, whole, part] when (byte_size(whole) + byte_size(part)) in 1..40 ->
        {float, ""} = Float.parse("#{zero(whole)}.#{zero(part)}")
        {:ok, signed(sign, float)}

      _no ->
        :error
    end
  end

  defp signed("-", number), do: -number
  defp signed(_plus, number), do: number

  defp zero(""), do: "0"
  defp zero(digits), do: digits
end
