defmodule Sim.Stage.Entities do
  @moduledoc """
  Reads a world file of Stage, and what it includes, into its properties and entities. Pure: files are read by a function.

      floorplan ( name "cave" size [16 16 0.8] bitmap "cave.png" )

  An entity that was named with `define NEW OLD ( … )` stands for the old one: its own properties win, and its entities come after
  those of its definition. An included file is looked for beside the file that includes it, then beside the world's file.
  """
  alias Sim.Stage.Tokens

  @largest 4_000_000
  @deepest 30
  @most 100_000
  @most_files 100

  @type at :: {file :: Path.t(), line :: pos_integer(), column :: pos_integer()}
  @type value :: float() | String.t() | [value()]
  @type properties :: %{String.t() => {at(), value()}}

  @typedoc "`type` is what it is in the end, `names` are those of its definitions, that which was written first."
  @type entity :: %{
          type: String.t(),
          names: [String.t()],
          at: at(),
          properties: properties(),
          entities: [entity()]
        }
  @type read :: (Path.t() -> {:ok, binary()} | {:error, reason :: String.t()})

  @doc """
  What a file says, or its first fault as one line with file, line and column.

      iex> read = fn _file -> {:ok, "define floorplan model (boundary 1)\\nfloorplan (bitmap \\"a.png\\")"} end
      iex> {:ok, %{entities: [walls]}} = Sim.Stage.Entities.read("a.world", read)
      iex> {walls.type, walls.names, Map.keys(walls.properties)}
      {"model", ["floorplan", "model"], ["bitmap", "boundary"]}
      iex> Sim.Stage.Entities.read("a.world", fn _file -> {:ok, "model\\n  (\\n"} end)
      {:error, "a.world:2:3: the ( here is never closed"}
  """
  @spec read(Path.t(), read()) ::
          {:ok, %{properties: properties(), entities: [entity()]}} | {:error, line :: String.t()}
  def read(file, read) do
    limits = %{bytes: 0, files: 0}

    with {:ok, tokens, _limits} <- tokens(file, [], %{read: read, world: file}, limits),
         {:ok, world} <- top(tokens, %{properties: %{}, entities: [], defines: %{}, size: 0}) do
      {:ok, %{properties: world.properties, entities: Enum.reverse(world.entities)}}
    else
      {:error, {{file, line, column}, text}} -> {:error, "#{file}:#{line}:#{column}: #{text}"}
      {:error, line} -> {:error, line}
    end
  end

  # The tokens of a file with those of included ones in their places; `within` are the files that include it.
  defp tokens(file, within, files, limits) do
    with {:ok, text} <- named(file, files.read.(file)),
         limits = %{bytes: limits.bytes + byte_size(text), files: limits.files + 1},
         :ok <- few(file, limits),
         {:ok, tokens} <- placed(file, Tokens.cut(text)),
         {:ok, parts, limits} <- included(tokens, [file | within], files, limits, []),
         do: {:ok, Enum.concat(Enum.reverse(parts)), limits}
  end

  defp named(file, {:error, reason}), do: {:error, "#{file}: #{reason}"}
  defp named(_file, ok), do: ok

  defp few(file, %{bytes: bytes}) when bytes > @largest,
    do: {:error, "#{file}: more than #{div(@largest, 1_000_000)} MB, with what is included"}

  defp few(file, %{files: files}) when files > @most_files,
    do: {:error, "#{file}: more than #{@most_files} files are included"}

  defp few(_file, _limits), do: :ok

  defp placed(file, {:error, {{line, column}, text}}),
    do: {:error, {{file, line, column}, text}}

  defp placed(file, {:ok, tokens}),
    do:
      {:ok, for({kind, {line, column}, value} <- tokens, do: {kind, {file, line, column}, value})}

  defp included([{:end, at, nil}], [_file], _files, limits, parts),
    do: {:ok, [[{:end, at, nil}] | parts], limits}

  defp included([{:end, _at, nil}], _within, _files, limits, parts), do: {:ok, parts, limits}

  defp included([{:word, at, "include"} | rest], [file | _] = within, files, limits, parts) do
    with [{:text, _at, name} | rest] <- rest,
         path = beside(name, [file, files.world], files.read),
         {false, _name} <- {path in within, name},
         {:ok, tokens, limits} <- tokens(path, within, files, limits) do
      included(rest, within, files, limits, [tokens | parts])
    else
      {true, name} -> {:error, {at, "#{name} includes itself"}}
      {:error, {_at, _text}} = error -> error
      {:error, line} -> {:error, {at, line}}
      _no_text -> {:error, {at, ~s(include is written: include "FILE")}}
    end
  end

  defp included([token | rest], within, files, limits, parts),
    do: included(rest, within, files, limits, [[token] | parts])

  @doc "The path of a file that others name: beside the first of these in whose folder it can be read, else beside the first."
  @spec beside(String.t(), [Path.t(), ...], read()) :: Path.t()
  def beside(name, files, read) do
    paths = for file <- files, uniq: true, do: file |> Path.dirname() |> joined(name)
    Enum.find(paths, hd(paths), &match?({:ok, _text}, read.(&1)))
  end

  # `..` is worked out, so that a file that includes itself has one path.
  defp joined(folder, name) do
    case Path.type(name) do
      :absolute -> Path.expand(name)
      _relative -> folder |> Path.join(name) |> Path.split() |> Enum.reduce([], &up/2) |> whole()
    end
  end

  defp up(".", done), do: done
  defp up("..", [last | done]) when last not in ["..", "/"], do: done
  defp up(part, done), do: [part | done]

  defp whole(parts), do: parts |> Enum.reverse() |> Path.join()

  defp top([{_kind, at, _value} | _rest], %{size: size}) when size > @most, do: many(at)
  defp top([{:end, _at, nil}], world), do: {:ok, world}

  defp top(
         [{:word, _, "define"}, {:word, _, new}, {:word, at, old}, {:mark, open, "("} | rest],
         w
       ) do
    with {:ok, body, rest} <- body(rest, open, w.defines, 1) do
      entity = expand(old, at, body, w.defines)
      entity = %{entity | names: [new | entity.names]}
      top(rest, %{w | defines: Map.put(w.defines, new, entity), size: w.size + entity.size})
    end
  end

  defp top([{:word, at, "define"} | _rest], _world),
    do: {:error, {at, "define is written: define new_name old_name ( … )"}}

  defp top([{:word, at, type}, {:mark, open, "("} | rest], world) do
    with {:ok, body, rest} <- body(rest, open, world.defines, 1) do
      entity = expand(type, at, body, world.defines)
      top(rest, %{world | entities: [entity | world.entities], size: world.size + entity.size})
    end
  end

  defp top([{:word, at, name} | rest], world) do
    with {:ok, value, rest} <- value(rest, name, at) do
      properties = Map.put(world.properties, name, {at, value})
      top(rest, %{world | properties: properties, size: world.size + 1})
    end
  end

  defp top([{_kind, at, value} | _rest], _world),
    do: {:error, {at, "#{shown(value)} is no property and no model"}}

  defp many(at),
    do: {:error, {at, "more than #{@most} properties, including those that define repeats"}}

  defp body(tokens, open, defines, depth, done \\ %{properties: %{}, entities: [], size: 1})

  defp body(_tokens, open, _defines, depth, _done) when depth > @deepest,
    do: {:error, {open, "nested more than #{@deepest} levels deep"}}

  defp body(_tokens, open, _defines, _depth, %{size: size}) when size > @most, do: many(open)

  defp body([{:mark, _at, ")"} | rest], _open, _defines, _depth, done),
    do: {:ok, %{done | entities: Enum.reverse(done.entities)}, rest}

  defp body([{:end, _at, nil}], open, _defines, _depth, _done),
    do: {:error, {open, "the ( here is never closed"}}

  defp body([{:word, at, type}, {:mark, inner, "("} | rest], open, defines, depth, done) do
    with {:ok, inner, rest} <- body(rest, inner, defines, depth + 1) do
      entity = expand(type, at, inner, defines)
      done = %{done | entities: [entity | done.entities], size: done.size + entity.size}
      body(rest, open, defines, depth, done)
    end
  end

  defp body([{:word, at, name} | rest], open, defines, depth, done) do
    with {:ok, value, rest} <- value(rest, name, at) do
      done = %{done | properties: Map.put(done.properties, name, {at, value})}
      body(rest, open, defines, depth, %{done | size: done.size + 1})
    end
  end

  defp body([{_kind, at, value} | _rest], _open, _defines, _depth, _done),
    do: {:error, {at, "#{shown(value)} is not the name of a property"}}

  defp expand(type, at, body, defines) do
    old =
      Map.get(defines, type, %{type: type, names: [type], properties: %{}, entities: [], size: 0})

    %{
      type: old.type,
      names: old.names,
      at: at,
      properties: Map.merge(old.properties, body.properties),
      entities: old.entities ++ body.entities,
      size: old.size + body.size
    }
  end

  defp value([{kind, _at, value} | rest], _name, _of) when kind in [:number, :text],
    do: {:ok, value, rest}

  # A word on the next line is the next property.
  defp value([{:word, {file, line, _}, word} | rest], _name, {file, line, _}),
    do: {:ok, word, rest}

  defp value([{:mark, at, "["} | rest], _name, _of), do: tuple(rest, at, 1, [])
  defp value(_other, name, at), do: {:error, {at, "#{shown(name)} has no value"}}

  defp tuple(_tokens, open, depth, _done) when depth > @deepest,
    do: {:error, {open, "nested more than #{@deepest} levels deep"}}

  defp tuple([{:mark, _at, "]"} | rest], _open, _depth, done),
    do: {:ok, Enum.reverse(done), rest}

  defp tuple([{kind, _at, value} | rest], open, depth, done) when kind in [:number, :text, :word],
    do: tuple(rest, open, depth, [value | done])

  defp tuple([{:mark, inner, "["} | rest], open, depth, done) do
    with {:ok, value, rest} <- tuple(rest, inner, depth + 1, []),
         do: tuple(rest, open, depth, [value | done])
  end

  defp tuple(_other, open, _depth, _done), do: {:error, {open, "the [ here is never closed"}}

  defp shown(nil), do: "the end of the file"
  defp shown(text) when is_binary(text), do: String.slice(text, 0, 40)
  defp shown(number), do: to_string(number)
end
