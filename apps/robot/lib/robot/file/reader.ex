defmodule Robot.File.Reader do
  @moduledoc """
  Reads a robot file as data: Elixir's notation for values, of which nothing is run. Pure.

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

  A node is `{line, value}`. Names stay text here: whoever knows what is allowed at a place compares
  with that, so that no file makes an atom.
  """
  alias Robot.File.Tokens

  @largest 65_536
  @deepest 32
  @largest_angle 36_000
  @closing %{"[" => "]", "{" => "}", "%{" => "}"}

  @type tree :: {line :: pos_integer(), value :: term()}
  @type problem :: {line :: pos_integer(), text :: String.t()}

  @doc """
  The tree of a text, or the line where it stops being one.

      iex> Robot.File.Reader.read("[start: {1.0, -2, deg(180)}]")
      {:ok, {1, {:keys, [{"start", 1, {1, {:tuple, [{1, 1.0}, {1, -2}, {1, :math.pi()}]}}}]}}}
      iex> Robot.File.Reader.read("[id: :mag1,\\n arm: halt()]")
      {:error, {2, "halt cannot be here: a robot file holds values only, it is read and not run"}}
      iex> Robot.File.Reader.read("[id: :mag1\\n arm: :auto]")
      {:error, {2, "a comma is missing before arm:"}}
  """
  @spec read(String.t()) :: {:ok, tree()} | {:error, problem()}
  def read(text) do
    with :ok <- text?(text),
         {:ok, tokens} <- Tokens.cut(text),
         {:ok, node, rest} <- first(tokens) do
      case rest do
        [{:end, _line, nil}] ->
          {:ok, node}

        [{_kind, line, _value} = token | _] ->
          {:error, {line, "#{shown(token)} stands behind the end of the list"}}
      end
    end
  end

  defp text?(text) do
    cond do
      byte_size(text) > @largest ->
        {:error, {1, "no robot file is larger than #{div(@largest, 1024)} kB"}}

      not String.valid?(text) ->
        {:error, {1, "is not text in UTF-8"}}

      true ->
        :ok
    end
  end

  defp first([{:end, _line, nil}]), do: {:error, {1, "is empty"}}
  defp first([{:mark, _line, "["} | _] = tokens), do: node(tokens, 0)

  defp first([{_kind, line, _value} | _]),
    do: {:error, {line, "a robot file is one list, [key: value, …]"}}

  defp node([{_kind, line, _value} | _], depth) when depth > @deepest,
    do: {:error, {line, "nothing is nested more than #{@deepest} deep"}}

  defp node([{kind, line, value} | rest], _depth) when kind in [:number, :text],
    do: {:ok, {line, value}, rest}

  defp node([{kind, line, name} | rest], _depth) when kind in [:name, :module] do
    case rest do
      [{:mark, at, "("} | _] -> {:error, {at, "#{name}( cannot be here#{only()}"}}
      _value -> {:ok, {line, {kind, name}}, rest}
    end
  end

  defp node([{:word, line, "true"} | rest], _depth), do: {:ok, {line, true}, rest}
  defp node([{:word, line, "false"} | rest], _depth), do: {:ok, {line, false}, rest}
  defp node([{:word, line, "nil"} | rest], _depth), do: {:ok, {line, nil}, rest}

  defp node([{:mark, _line, sign}, {:number, line, number} | rest], _depth)
       when sign in ["-", "+"],
       do: {:ok, {line, if(sign == "-", do: -number, else: number)}, rest}

  defp node([{:word, line, "deg"}, {:mark, _, "("} | rest], depth) do
    case node(rest, depth + 1) do
      {:ok, {_line, degrees}, [{:mark, _, ")"} | rest]}
      when is_number(degrees) and abs(degrees) <= @largest_angle ->
        {:ok, {line, degrees * :math.pi() / 180}, rest}

      _other ->
        {:error,
         {line, "deg(…) takes degrees, a number from -#{@largest_angle} to #{@largest_angle}"}}
    end
  end

  defp node([{:mark, line, open} | rest], depth) when is_map_key(@closing, open) do
    with {:ok, items, rest} <- items(rest, {open, line}, depth + 1, []),
         {:ok, value} <- value(open, items, line) do
      {:ok, {line, value}, rest}
    end
  end

  defp node([{:end, line, nil} | _], _depth),
    do: {:error, {line, "a value is missing at the end"}}

  defp node([{:mark, line, mark} | _], _depth) when mark in ["-", "+", "(", "=>"],
    do: {:error, {line, "#{mark} cannot be here#{only()}"}}

  defp node([{:mark, line, mark} | _], _depth),
    do: {:error, {line, "a value is missing before #{mark}"}}

  defp node([{:key, line, key} | _], _depth),
    do: {:error, {line, "a value is missing before #{key}:"}}

  defp node([{_kind, line, _value} = token | _], _depth),
    do: {:error, {line, "#{shown(token)} cannot be here#{only()}"}}

  # Up to the closing mark; a comma may stand behind the last.
  defp items([{:mark, _line, mark} | rest], {open, _at}, _depth, done)
       when mark == :erlang.map_get(open, @closing),
       do: {:ok, Enum.reverse(done), rest}

  defp items(tokens, opened, depth, done) do
    with {:ok, item, rest} <- item(tokens, opened, depth) do
      case rest do
        [{:mark, _line, ","} | rest] ->
          items(rest, opened, depth, [item | done])

        [{:mark, _line, mark} | _] when mark in ["]", "}"] ->
          close(rest, opened, depth, [item | done])

        [{:end, _line, nil} | _] ->
          {:error, never_closed(opened)}

        [token | _] ->
          {:error, {elem(token, 1), between(token)}}
      end
    end
  end

  defp close([{:mark, line, mark} | _] = tokens, {open, at} = opened, depth, done) do
    if mark == @closing[open],
      do: items(tokens, opened, depth, done),
      else: {:error, {line, "#{mark} cannot close the #{open} of line #{at}"}}
  end

  defp item([{:end, _line, nil} | _], opened, _depth), do: {:error, never_closed(opened)}

  defp item([{:key, line, key} | rest], {open, _at}, depth) when open != "%{" do
    with {:ok, node, rest} <- node(rest, depth), do: {:ok, {key, line, node}, rest}
  end

  defp item(tokens, {"%{", _at}, depth) do
    with {:ok, key, rest} <- node(tokens, depth) do
      case rest do
        [{:mark, _line, "=>"} | rest] ->
          with {:ok, value, rest} <- node(rest, depth), do: {:ok, {key, value}, rest}

        [{_kind, line, _value} | _] ->
          {:error, {line, "a map is written %{key => value}"}}
      end
    end
  end

  defp item(tokens, _opened, depth), do: node(tokens, depth)

  defp never_closed({open, line}), do: {line, "the #{open} of line #{line} is never closed"}

  # What stands where a comma should is more often a forgotten comma than a sum.
  defp between({:mark, _line, mark}) when mark in ["-", "+", "(", ")", "=>"],
    do: "#{mark} cannot be here#{only()}"

  defp between(token), do: "a comma is missing before #{shown(token)}"

  defp only, do: ": a robot file holds values only, it is read and not run"

  defp value("%{", pairs, _line), do: {:ok, {:map, pairs}}

  defp value("[", items, line) do
    case Enum.split_with(items, &key?/1) do
      {[], nodes} -> {:ok, {:list, nodes}}
      {keys, []} -> {:ok, {:keys, keys}}
      _mixed -> {:error, {line, "a list has keys for all its values or for none"}}
    end
  end

  defp value("{", items, line) do
    case Enum.split_while(items, &(not key?(&1))) do
      {nodes, []} ->
        {:ok, {:tuple, nodes}}

      {nodes, [{_key, at, _node} | _] = keys} ->
        if Enum.all?(keys, &key?/1),
          do: {:ok, {:tuple, nodes ++ [{at, {:keys, keys}}]}},
          else: {:error, {line, "in a tuple, keys come last"}}
    end
  end

  defp key?(item), do: tuple_size(item) == 3

  defp shown({:key, _line, name}), do: name <> ":"
  defp shown({:name, _line, name}), do: ":" <> name
  defp shown({:text, _line, _text}), do: "text"
  defp shown({:number, _line, number}), do: to_string(number)
  defp shown({_kind, _line, value}), do: to_string(value)
end
