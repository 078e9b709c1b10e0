defmodule Hal.Cli.Arguments do
  @moduledoc """
  Reads the arguments of a command by a list of options. Pure.

  Written for values that begin with a minus sign (`--landmark -2,1`), for options that may be
  repeated, and for errors that say what is allowed. An option is `{name, hint, check, help}`: `hint`
  is how its value is shown in the help, or `nil` for a switch; `check` turns the text into the value. A value whose hint is in
  brackets, such as `[PORT]`, may be left out at the end and before another option, and is the text `""` then.
  Every command also takes `--help`, or `-h`.
  """
  alias Hal.Options.Wording
  alias Hal.Options.Suggest

  @typedoc "What is allowed, and a hint about what may have been meant."
  @type allowed :: String.t() | {String.t(), hint :: String.t()}
  @type check :: (String.t() -> {:ok, term()} | {:error, allowed()})
  @type option ::
          {name :: String.t(), hint :: String.t() | nil, check() | nil, help :: String.t()}

  @help {"help", nil, nil, "this text"}

  @doc """
  The values in the order in which they were given, or one line for each error.

      iex> count = {"count", "N", &Hal.Cli.Parse.whole(&1, 1..9), "how many"}
      iex> Hal.Cli.Arguments.parse(~w(--count 3), [count])
      {:ok, [{"count", 3}]}
      iex> Hal.Cli.Arguments.parse(~w(--count=0 --cuont 2), [count])
      {:error,
       [
         ~s(--count: expected a whole number from 1 to 9, got "0"),
         "unknown option --cuont; did you mean --count?"
       ]}
      iex> port = {"port", "[PORT]", &{:ok, &1}, "where"}
      iex> Hal.Cli.Arguments.parse(~w(--port --count 3 --port 80), [count, port])
      {:ok, [{"port", ""}, {"count", 3}, {"port", "80"}]}
  """
  @spec parse([String.t()], [option()]) ::
          {:ok, [{String.t(), term()}]} | {:error, [String.t()]}
  def parse(arguments, options) do
    arguments = Enum.map(arguments, &if(&1 == "-h", do: "--help", else: &1))
    results = read(arguments, options ++ [@help])

    case for {:error, line} <- results, do: line do
      [] -> {:ok, for({:ok, pair} <- results, do: pair)}
      lines -> {:error, lines}
    end
  end

  @doc """
  The same for a command that takes words, too: the values, and the words between them.

      iex> every = {"every", "N", &Hal.Cli.Parse.whole(&1, 1..9), "each how many"}
      iex> Hal.Cli.Arguments.parse_words(~w(a.png --every 2 b.png), [every])
      {:ok, [{"every", 2}], ~w(a.png b.png)}
  """
  @spec parse_words([String.t()], [option()]) ::
          {:ok, [{String.t(), term()}], words :: [String.t()]} | {:error, [String.t()]}
  def parse_words(arguments, options) do
    {words, rest} = words(arguments, options)
    with {:ok, pairs} <- parse(rest, options), do: {:ok, pairs, words}
  end

  @doc """
  Splits arguments into words that stand alone and options with their values, for a command that takes files.

      iex> options = [{"record", "DIR", &{:ok, &1}, ""}, {"quiet", nil, nil, ""}]
      iex> Hal.Cli.Arguments.words(~w(a.exs --record out --quiet b.exs --record=c d.exs), options)
      {~w(a.exs b.exs d.exs), ~w(--record out --quiet --record=c)}
  """
  @spec words([String.t()], [option()]) :: {words :: [String.t()], rest :: [String.t()]}
  def words(arguments, options), do: words(arguments, options, [], [])

  defp words(["--" <> name = option, value | rest], options, words, others) do
    case List.keyfind(options, name, 0) do
      {_name, hint, _check, _help} when hint != nil ->
        words(rest, options, words, [value, option | others])

      _switch_or_unknown ->
        words([value | rest], options, words, [option | others])
    end
  end

  defp words(["-" <> _ = option | rest], options, words, others),
    do: words(rest, options, words, [option | others])

  defp words([word | rest], options, words, others),
    do: words(rest, options, [word | words], others)

  defp words([], _options, words, others), do: {Enum.reverse(words), Enum.reverse(others)}

  @doc "The options as aligned lines for a help text."
  @spec help([option()]) :: String.t()
  def help(options) do
    rows =
      Enum.map(options ++ [@help], fn {name, hint, _check, help} -> {usage(name, hint), help} end)

    width = rows |> Enum.map(fn {left, _help} -> String.length(left) end) |> Enum.max()

    Enum.map_join(rows, "\n", fn {left, help} ->
      lines = String.split(help, "\n")
      indent = "\n" <> String.duplicate(" ", width + 4)
      "  " <> String.pad_trailing(left, width) <> "  " <> Enum.join(lines, indent)
    end)
  end

  defp usage(name, nil), do: "--#{name}"
  defp usage(name, hint), do: "--#{name} #{hint}"

  defp read([], _options), do: []

  defp read(["--" <> text | rest], options) do
    {name, inline} =
      case String.split(text, "=", parts: 2) do
        [name] -> {name, nil}
        [name, value] -> {name, value}
      end

    case List.keyfind(options, name, 0) do
      nil -> unknown(name, inline, rest, options)
      {_name, nil, _check, _help} -> switch(name, inline, rest, options)
      {_name, hint, check, _help} -> valued({name, hint, check}, inline, rest, options)
    end
  end

  defp read([word | rest], options) do
    hint = if known?(word, options), do: "; did you mean --#{word}?", else: ""
    [{:error, "unexpected argument #{inspect(word)}#{hint}"} | read(rest, options)]
  end

  defp switch(name, nil, rest, options), do: [{:ok, {name, true}} | read(rest, options)]

  defp switch(name, _value, rest, options),
    do: [{:error, "--#{name} takes no value"} | read(rest, options)]

  defp valued(option, nil, ["--" <> _ | _] = rest, options),
    do: [missing(option) | read(rest, options)]

  defp valued(option, nil, [], _options), do: [missing(option)]

  defp valued(option, nil, [value | rest], options),
    do: [checked(option, value) | read(rest, options)]

  defp valued(option, value, rest, options), do: [checked(option, value) | read(rest, options)]

  defp missing({_name, "[" <> _, _check} = option), do: checked(option, "")
  defp missing({name, hint, _check}), do: {:error, "--#{name} needs a value: #{hint}"}

  defp checked({name, _hint, check}, text) do
    case check.(text) do
      {:ok, value} -> {:ok, {name, value}}
      {:error, allowed} -> refuse("--#{name}", text, allowed)
    end
  end

  @doc """
  The error for a text that is not what is allowed, in the words of `Hal.Options`.

      iex> Hal.Cli.Arguments.refuse("--map", "hal", {"hall or arena", "; did you mean hall?"})
      {:error, ~s(--map: expected hall or arena, got "hal"; did you mean hall?)}
  """
  @spec refuse(String.t(), String.t(), allowed()) :: {:error, String.t()}
  def refuse(name, text, {allowed, hint}) do
    {:error, [{[], words}]} = Wording.refuse(allowed, text)
    {:error, "#{name}: #{words}#{hint}"}
  end

  def refuse(name, text, allowed), do: refuse(name, text, {allowed, ""})

  # The value of an unknown option is skipped too, so that one mistake gives one line.
  defp unknown(name, inline, rest, options) do
    names = Enum.map(options, &("--" <> elem(&1, 0)))
    error = {:error, "unknown option --#{name}#{hint("--" <> name, names)}"}

    case rest do
      ["--" <> _ | _] -> [error | read(rest, options)]
      [_value | rest] when inline == nil -> [error | read(rest, options)]
      rest -> [error | read(rest, options)]
    end
  end

  # So few are named all.
  defp hint(word, names) do
    with "" when length(names) <= 12 <- Suggest.hint(word, names),
         do: "; known are #{Enum.join(names, ", ")}"
  end

  defp known?(word, options), do: List.keymember?(options, word, 0)
end
