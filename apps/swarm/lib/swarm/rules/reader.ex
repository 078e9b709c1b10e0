defmodule Swarm.Rules.Reader do
  @moduledoc """
  Reads rules (`Swarm.Rules`) from a text or a file in Elixir's notation. Nothing of it is run, and no name in it becomes an
  atom.
  """
  alias Swarm.Rules.Rule

  @most_bytes 200_000
  @most_rules 1_000
  @most_values 6
  @tests [:<, :<=, :>, :>=, :==, :!=]

  @doc "The rules of a file, or what is wrong with it, in one line with the number of its line."
  @spec file(Path.t()) :: {:ok, [Rule.t()]} | {:error, line :: String.t()}
  def file(path) do
    with {:read, {:ok, %{size: size}}} when size <= @most_bytes <- {:read, File.stat(path)},
         {:read, {:ok, text}} <- {:read, File.read(path)} do
      with {:error, line} <- text(text), do: {:error, "#{path}:#{line}"}
    else
      {:read, {:ok, _large}} -> {:error, "#{path}: expected at most #{@most_bytes} bytes"}
      {:read, {:error, reason}} -> {:error, "#{path}: #{:file.format_error(reason)}"}
    end
  end

  @doc """
  The rules of a text.

      iex> Swarm.Rules.Reader.text("rule \\"a\\" do\\n  at(x)\\n  propose go(y)\\nend")
      {:error, ~s|1: rule "a": y in propose is in no line before it|}
      iex> Swarm.Rules.Reader.text("rule \\"a\\" do\\n  File.rm(x)\\n  propose go(x)\\nend")
      {:error, ~s|1: rule "a": expected a fact such as at(robot, x), where, absent, conclude or propose|}
  """
  @spec text(String.t()) :: {:ok, [Rule.t()]} | {:error, line :: String.t()}
  def text(text) do
    options = [
      static_atoms_encoder: fn name, _meta -> {:ok, {:name, name}} end,
      emit_warnings: false
    ]

    case Code.string_to_quoted(text, options) do
      {:ok, {:__block__, _meta, rules}} when length(rules) <= @most_rules ->
        rules(rules, [])

      {:ok, {:__block__, _meta, _many}} ->
        {:error, "1: expected at most #{@most_rules} rules"}

      {:ok, rule} ->
        rules([rule], [])

      {:error, {meta, _message, _token}} ->
        {:error, "#{meta[:line] || 1}: this is not Elixir's notation"}
    end
  end

  defp rules([], read), do: {:ok, Enum.reverse(read)}

  defp rules([{{:name, "rule"}, meta, [name | given]} | rest], read) do
    with {:ok, options, block} <- given(given),
         {:ok, rule} <- rule(name, options, block) do
      rules(rest, [rule | read])
    else
      {:error, line} -> {:error, "#{meta[:line]}: rule #{inspect(name)}: #{line}"}
    end
  end

  defp rules([other | _rest], _read),
    do: {:error, "#{line(other)}: expected rule \"name\", priority: 0 do … end"}

  defp line({_name, meta, _arguments}) when is_list(meta), do: meta[:line] || 1
  defp line(_other), do: 1

  defp given([options, [{word, block}]]) when is_list(options),
    do: with_block(options, word, block)

  defp given([[{word, block}]]), do: with_block([], word, block)
  defp given(_other), do: {:error, "expected do … end"}

  defp with_block(options, word, block),
    do: if(name(word) == "do", do: {:ok, options, block}, else: {:error, "expected do … end"})

  @doc "A rule from its parts, as Elixir's parser has them."
  @spec rule(term(), term(), Macro.t()) :: {:ok, Rule.t()} | {:error, line :: String.t()}
  def rule(name, options, block) when is_binary(name) do
    lines = with {:__block__, _meta, lines} <- block, do: lines, else: (one -> [one])

    with {:ok, priority} <- priority(options),
         {:ok, lines, then} <- lines(lines, [], [], MapSet.new()),
         do: {:ok, %Rule{name: name, priority: priority, lines: lines, then: then}}
  end

  def rule(_name, _options, _block), do: {:error, "expected a name in quotes"}

  defp priority([]), do: {:ok, 0}

  defp priority([{key, priority}]) when is_integer(priority),
    do: if(name(key) == "priority", do: {:ok, priority}, else: priority(:other))

  defp priority(_other), do: {:error, "expected priority: a whole number"}

  defp lines([], _lines, [], _bound), do: {:error, "expected a line with conclude or propose"}
  defp lines([], [], _then, _bound), do: {:error, "expected a fact, such as at(robot, x)"}
  defp lines([], lines, then, _bound), do: {:ok, Enum.reverse(lines), Enum.reverse(then)}

  defp lines([line | rest], lines, then, bound) do
    case read(line, bound) do
      {:ok, {kind, _} = read, more} when kind in [:fact, :where, :absent] ->
        lines(rest, [read | lines], then, more)

      {:ok, read, _bound} ->
        lines(rest, lines, [read | then], bound)

      {:error, line} ->
        {:error, line}
    end
  end

  defp read({word, _meta, arguments} = line, bound) when is_list(arguments) do
    case {name(word), arguments} do
      {"where", [test]} ->
        with {:ok, tests} <- tests(test, bound), do: {:ok, {:where, tests}, bound}

      {"absent", [fact]} ->
        with {:ok, pattern} <- pattern(fact), do: {:ok, {:absent, pattern}, bound}

      {kind, [fact]} when kind in ["conclude", "propose"] ->
        with {:ok, pattern} <- pattern(fact),
             :ok <- known(pattern, bound, kind),
             do: {:ok, {if(kind == "propose", do: :propose, else: :conclude), pattern}, bound}

      _fact ->
        with {:ok, pattern} <- pattern(line),
             do: {:ok, {:fact, pattern}, MapSet.union(bound, variables(pattern))}
    end
  end

  defp read(_other, _bound), do: strange()

  defp strange,
    do: {:error, "expected a fact such as at(robot, x), where, absent, conclude or propose"}

  defp pattern({word, _meta, values}) when is_list(values) and length(values) <= @most_values do
    name = name(word)
    values = Enum.map(values, &value/1)

    if is_binary(name) and name =~ ~r/\A[a-z][a-z0-9_]{0,40}\z/ and :error not in values,
      do: {:ok, [name | values]},
      else: strange()
  end

  defp pattern(_other), do: strange()

  defp value({word, _meta, context}) when is_atom(context) do
    case name(word) do
      "_" <> _any -> :any
      name when is_binary(name) -> {:var, name}
      _other -> :error
    end
  end

  defp value({:name, text}) when is_binary(text), do: {:value, {:name, text}}
  defp value({:-, _meta, [number]}) when is_number(number), do: {:value, -number}
  defp value({{:name, "-"}, _meta, [number]}) when is_number(number), do: {:value, -number}

  defp value(value) when is_number(value) or is_binary(value) or is_atom(value),
    do: {:value, value}

  defp value(_other), do: :error

  defp variables(pattern), do: MapSet.new(for {:var, name} <- pattern, do: name)

  defp known(pattern, bound, where) do
    cond do
      :any in pattern ->
        {:error, "_ in #{where} says nothing"}

      free = Enum.find(variables(pattern), &(&1 not in bound)) ->
        {:error, "#{free} in #{where} is in no line before it"}

      true ->
        :ok
    end
  end

  defp tests({word, _meta, [left, right]}, bound) do
    case name(word) do
      "and" ->
        with {:ok, left} <- tests(left, bound),
             {:ok, right} <- tests(right, bound),
             do: {:ok, left ++ right}

      op ->
        {left, right} = {value(left), value(right)}

        with op when op != nil <- Enum.find(@tests, &(Atom.to_string(&1) == op)),
             false <- :error in [left, right],
             :ok <- known([left, right], bound, "where") do
          {:ok, [{op, left, right}]}
        else
          {:error, line} -> {:error, line}
          _other -> {:error, "where: expected comparisons of variables and values, joined by and"}
        end
    end
  end

  defp tests(_other, _bound),
    do: {:error, "where: expected comparisons of variables and values, joined by and"}

  # Of a module a word is an atom, of a text it is not.
  defp name({:name, text}), do: text
  defp name(word) when is_atom(word), do: Atom.to_string(word)
  defp name(_other), do: nil
end
