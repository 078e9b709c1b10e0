defmodule Robot.File.Reader do
  @moduledoc """
  Reads a robot file as data: Elixir's notation for values, none of which is executed. Pure.

  | may be written | becomes |
  |---|---|
  | numbers, `-x`, `0x40`, `1_000`, text in `"` | the value |
  | `deg(x)` | x degrees in radians |
  | `true`, `false`, `nil` | the value |
  | `:name` | `{:name, "name"}` |
  | `Some.Module` | `{:module, "Some.Module"}` |
  | `[…]`, `{…}` | `{:list, nodes}`, `{:tuple, nodes}` |
  | `[key: …]`, also as the last of a tuple | `{:keys, [{"key", line, node}]}` |
  | `%{… => …}` | `{:map, [{node, node}]}` |

  A node is `{line, value}`. Names remain text here and are compared later with the values that
  are allowed, so that a file never creates atoms.
  """

  alias Hal.Options.Wording

  @largest 65_536
  @most_lines 40
  @deepest 32
  @largest_angle 36_000
  # Stands for all names while the parser only looks for errors.
  @name :"…"
  @mixed "a list has keys for all its values or for none"
  @behind "nothing can stand behind the end of the list"
  @into "nothing is put into text: \#{…} cannot be here"
  @only ": a robot file holds values only, it is read and not run"

  @type tree :: {line :: pos_integer(), value :: term()}
  @type problem :: {line :: pos_integer(), text :: String.t()}
  @typedoc """
  As from `Code.string_to_quoted/2`, with literals as `{:literal, meta, value}` and names as
  `{:name, text}`.
  """
  @type quoted :: term()

  @doc """
  The text of a file of at most 64 kB; the error is one line. `what` is what the file should be.

      iex> Robot.File.Reader.text("no/such.exs", "scenario")
      {:error, ["no/such.exs: no such file or directory"]}
  """
  @spec text(Path.t(), what :: String.t()) :: {:ok, String.t()} | {:error, [String.t(), ...]}
  def text(path, what \\ "robot file") do
    # Reading a pipe or a device might never end.
    with {:ok, %File.Stat{type: :regular, size: size}} when size <= @largest <- File.stat(path),
         {:ok, text} <- File.read(path) do
      # Some editors write a byte-order mark.
      {:ok, String.replace_prefix(text, "\uFEFF", "")}
    else
      {:ok, %File.Stat{type: :regular}} ->
        {:error, ["#{path}: no #{what} is larger than #{div(@largest, 1024)} kB"]}

      {:ok, %File.Stat{type: type}} ->
        {:error, ["#{path}: is a #{type}, where a file is needed"]}

      {:error, reason} ->
        {:error, ["#{path}: #{:file.format_error(reason)}"]}
    end
  end

  @doc """
  The problems of a file as lines. A person works through the first ones first; a count of the others is enough.

      iex> Robot.File.Reader.lines([{3, ["arm"], "is missing"}], "mag1.exs")
      ["mag1.exs:3: arm: is missing"]
  """
  @spec lines([{pos_integer(), path :: [String.t()], String.t()}], file :: String.t()) :: [
          String.t()
        ]
  def lines(problems, file) do
    more = length(problems) - @most_lines
    lines = problems |> Enum.take(@most_lines) |> Enum.map(&line(&1, file))
    if more > 0, do: lines ++ ["#{file}: and #{more} problems more"], else: lines
  end

  defp line({line, [], text}, file), do: "#{file}:#{line}: #{text}"
  defp line({line, path, text}, file), do: "#{file}:#{line}: #{Wording.path(path)}: #{text}"

  @doc """
  The tree of a text, or the first problem with its line.

      iex> Robot.File.Reader.read("[start: {1.0, -2, deg(180)}]")
      {:ok, {1, {:keys, [{"start", 1, {1, {:tuple, [{1, 1.0}, {1, -2}, {1, :math.pi()}]}}}]}}}
      iex> Robot.File.Reader.read("[id: :mag1,\\n arm: halt()]")
      {:error, {2, "halt cannot be here: a robot file holds values only, it is read and not run"}}
      iex> Robot.File.Reader.read("[id: :mag1\\n arm: :auto]")
      {:error, {2, "a comma or a value is missing before arm:"}}
  """
  @spec read(String.t()) :: {:ok, tree()} | {:error, problem()}
  def read(text), do: read(text, "robot file")

  @doc """
  The same for another kind of file in this notation, which messages call `what`.

      iex> Robot.File.Reader.read("halt()", "scenario")
      {:error, {1, "a scenario is one list, [key: value, …]"}}
  """
  @spec read(String.t(), what :: String.t()) :: {:ok, tree()} | {:error, problem()}
  def read(text, what) do
    with {:error, {line, words}} <- tree(text),
         do: {:error, {line, String.replace(words, "robot file", what)}}
  end

  defp tree(text) do
    case quoted(text) do
      {:ok, {:literal, _meta, list} = quoted} when is_list(list) -> {:ok, node(quoted, 0)}
      {:ok, {:__block__, _meta, []}} -> {:error, {1, "is empty"}}
      {:ok, {:__block__, _meta, [_list, more | _]}} -> {:error, {line(more), @behind}}
      {:ok, other} -> {:error, {line(other), "a robot file is one list, [key: value, …]"}}
      {:error, problem} -> {:error, problem}
    end
  catch
    {:problem, line, text} -> {:error, {line, text}}
  end

  @doc """
  The result of Elixir's parser for a text, with lines and columns. Checks the size, the encoding
  and the syntax of the text, not whether its values are allowed.
  """
  @spec quoted(String.t()) :: {:ok, quoted()} | {:error, problem()}
  def quoted(text) do
    cond do
      byte_size(text) > @largest ->
        {:error, {1, "no robot file is larger than #{div(@largest, 1024)} kB"}}

      not String.valid?(text) ->
        {:error, {1, "is not text in UTF-8"}}

      true ->
        # The parser puts names into its messages, and raises if one is not an atom. So the first
        # pass, which finds errors, uses one atom for all names.
        with {:ok, _quoted} <- parse(text, fn _name -> @name end), do: parse(text, &{:name, &1})
    end
  end

  defp parse(text, name) do
    options = [
      columns: true,
      token_metadata: true,
      # `emit_warnings` is for Elixir 1.16 and later.
      emit_warnings: false,
      warnings: false,
      static_atoms_encoder: fn text, _meta -> {:ok, name.(text)} end,
      literal_encoder: fn value, meta -> {:ok, {:literal, meta, value}} end
    ]

    with {:error, {meta, message, token}} <- Code.string_to_quoted(text, options),
         do: {:error, {meta[:line], syntax(message, token, text, meta)}}
  end

  # The parser's token may be the substitute for all names, so the word is read from the text.
  defp syntax("syntax error before: ", _token, text, meta) do
    case word(text, meta) do
      nil -> "a value is missing at the end"
      word -> "a comma or a value is missing before #{shorten(word)}"
    end
  end

  # The parser gives the place of the comma.
  defp syntax("unexpected expression after keyword list" <> _, _token, _text, _meta),
    do: "what follows this comma has no key: #{@mixed}"

  defp syntax({before, behind}, token, _text, _meta), do: shorten(before <> token <> behind)

  # The message's further sentences are advice for programs.
  defp syntax(message, token, text, meta) do
    word = String.trim_trailing(word(text, meta) || "", ":")
    message = message <> String.replace(token, "#{@name}", word)
    # Newer parsers give the line of the opening bracket, and the line of the error as `end_line`.
    end_line = if line = meta[:end_line], do: " in line #{line}", else: ""
    (message |> String.split([". ", "\n"]) |> hd() |> shorten()) <> end_line
  end

  defp word(text, meta) do
    line = text |> String.split("\n") |> Enum.at(meta[:line] - 1, "")
    rest = String.slice(line, (meta[:column] || 1) - 1, 255)
    with [word] <- Regex.run(~r/^\w+:?|^\S/u, rest), do: word
  end

  defp node(quoted, depth) when depth > @deepest,
    do: problem(quoted, "nothing is nested more than #{@deepest} deep")

  defp node({:literal, meta, number} = quoted, _depth) when is_number(number) do
    token = Keyword.get(meta, :token, "")
    if byte_size(token) > 40, do: problem(quoted, "#{shorten(token)} is not a number")
    {line(quoted), number}
  end

  defp node({:literal, meta, list} = quoted, depth) when is_list(list) do
    if meta[:delimiter], do: refuse(quoted, "text in '")

    case Enum.split_with(list, &pair?/1) do
      {[], items} -> {line(quoted), {:list, Enum.map(items, &node(&1, depth + 1))}}
      {pairs, []} -> {line(quoted), keys(pairs, depth + 1)}
      _mixed -> problem(quoted, @mixed)
    end
  end

  defp node({:literal, _meta, {:name, name}} = quoted, _depth), do: {line(quoted), {:name, name}}

  defp node({:literal, _meta, {one, other}} = quoted, depth),
    do: {line(quoted), tuple([one, other], depth + 1)}

  defp node({:literal, _meta, value} = quoted, _depth), do: {line(quoted), value}
  defp node({:{}, _meta, items} = quoted, depth), do: {line(quoted), tuple(items, depth + 1)}

  defp node({:%{}, _meta, pairs} = quoted, depth) do
    unless Enum.all?(pairs, &(pair?(&1) and not key?(&1))),
      do: problem(quoted, "a map is written %{key => value}")

    pairs = for {key, value} <- pairs, do: {node(key, depth + 1), node(value, depth + 1)}
    {line(quoted), {:map, pairs}}
  end

  defp node({:__aliases__, _meta, names} = quoted, _depth) do
    unless Enum.all?(names, &match?({:name, _}, &1)), do: refuse(quoted, "a call")
    {line(quoted), {:module, Enum.map_join(names, ".", &elem(&1, 1))}}
  end

  defp node({sign, _meta, [{:literal, _, number} = quoted]}, depth)
       when sign in [:-, :+] and is_number(number) do
    {line, number} = node(quoted, depth)
    {line, if(sign == :-, do: -number, else: number)}
  end

  defp node({{:name, "deg"}, _meta, arguments} = quoted, depth) when is_list(arguments) do
    case Enum.map(arguments, &node(&1, depth + 1)) do
      [{_line, degrees}] when is_number(degrees) and abs(degrees) <= @largest_angle ->
        {line(quoted), degrees * :math.pi() / 180}

      _other ->
        takes = "a number from -#{@largest_angle} to #{@largest_angle}"
        problem(quoted, "deg(…) takes degrees, #{takes}")
    end
  end

  defp node({:"::", _meta, [{{:name, name}, _, nil} | _]} = quoted, _depth),
    do: problem(quoted, "a space is missing after #{shorten(name)}:")

  defp node({:<<>>, meta, _parts} = quoted, _depth),
    do: if(meta[:delimiter], do: problem(quoted, @into), else: refuse(quoted, "<<>>"))

  defp node({{:., _, [:erlang, _to_atom]}, _meta, _parts} = quoted, _depth),
    do: problem(quoted, @into)

  defp node({{:name, name}, _meta, _arguments} = quoted, _depth), do: refuse(quoted, name)
  defp node({:__block__, _meta, _many} = quoted, _depth), do: refuse(quoted, "( )")
  defp node({word, _, _} = quoted, _depth) when is_atom(word), do: refuse(quoted, "#{word}")
  defp node(quoted, _depth), do: refuse(quoted, "a call")

  # Keys at the end of a tuple need no brackets.
  defp tuple(items, depth) do
    {:tuple,
     Enum.map(items, fn
       [{key, _value} | _] = pairs -> {line(key), keys(pairs, depth)}
       item -> node(item, depth)
     end)}
  end

  defp keys(pairs, depth),
    do: {:keys, for({key, value} <- pairs, do: {key(key), line(key), node(value, depth)})}

  defp key({:literal, _meta, {:name, name}}), do: name
  defp key({:literal, _meta, word}), do: Atom.to_string(word)
  defp key(quoted), do: problem(quoted, @into)

  defp pair?(quoted), do: is_tuple(quoted) and tuple_size(quoted) == 2
  defp key?({{_, meta, _}, _value}), do: meta[:format] == :keyword

  # A list of keys without brackets has the line of its first key.
  defp line([{key, _value} | _]), do: line(key)
  defp line({_, meta, _}), do: Keyword.get(meta, :line, 1)
  defp line(_other), do: 1

  @spec refuse(quoted(), String.t()) :: no_return()
  defp refuse(quoted, what), do: problem(quoted, shorten(what) <> " cannot be here" <> @only)

  @spec problem(quoted(), String.t()) :: no_return()
  defp problem(quoted, text), do: throw({:problem, line(quoted), text})

  defp shorten(text),
    do: if(String.length(text) > 160, do: String.slice(text, 0, 157) <> "…", else: text)
end
