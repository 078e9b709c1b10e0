defmodule Player.Sections do
  @moduledoc """
  Reads a configuration file of the Player device server into its sections. Pure.

      driver ( name "rflex" provides ["position:0"] mm_length 500 )

  is `%{type: "driver", line: 1, options: [{"name", 1, "rflex"}, …], sections: []}`. A value is a
  number, a text or `{:tuple, values}`. Sections may hold sections; a section that was named with
  `define NEW OLD ( … )` stands for the old one with these options. `include` is not followed, but
  reported with its line.
  """
  alias Player.Tokens

  @largest 1_048_576
  @deepest 20
  @most 20_000

  @type value :: number() | String.t() | {:tuple, [value()]}
  @type option :: {name :: String.t(), line :: pos_integer(), value()}
  @type section :: %{
          type: String.t(),
          line: pos_integer(),
          options: [option()],
          sections: [section()]
        }
  @type file :: %{
          options: [option()],
          sections: [section()],
          includes: [{line :: pos_integer(), String.t()}]
        }

  @doc """
  The sections of a file, or its first fault with its line.

      iex> {:ok, file} = Player.Sections.parse("driver\\n(\\n  name \\"rflex\\"\\n)")
      iex> file.sections
      [%{type: "driver", line: 1, options: [{"name", 3, "rflex"}], sections: []}]
      iex> Player.Sections.parse("driver\\n(\\n  name \\"rflex\\"\\n")
      {:error, {2, "the ( here is never closed"}}
  """
  @spec parse(String.t()) :: {:ok, file()} | {:error, {pos_integer(), String.t()}}
  def parse(text) when byte_size(text) > @largest,
    do: {:error, {1, "the file is larger than #{div(@largest, 1024)} kB"}}

  def parse(text) do
    empty = %{options: [], sections: [], includes: [], defines: %{}, size: 0}

    with {:ok, tokens} <- Tokens.cut(text),
         {:ok, file} <- top(tokens, empty) do
      {:ok,
       %{
         options: Enum.reverse(file.options),
         sections: file.sections |> Enum.reverse() |> Enum.map(&plain/1),
         includes: Enum.reverse(file.includes)
       }}
    end
  end

  defp top(_tokens, %{size: size}) when size > @most,
    do: {:error, {1, "more than #{@most} options, including those that define repeats"}}

  defp top([{:end, _line, nil}], file), do: {:ok, file}

  defp top([{:word, line, "include"}, {:text, _, name} | rest], file),
    do: top(rest, %{file | includes: [{line, name} | file.includes]})

  defp top(
         [{:word, _line, "define"}, {:word, _, new}, {:word, _, old}, {:mark, at, "("} | rest],
         file
       ) do
    with {:ok, body, rest} <- body(rest, at, file.defines, 1) do
      section = expand(old, at, body, file.defines)

      # Of two definitions with one name, Player takes the first.
      defines = Map.put_new(file.defines, new, section)
      top(rest, %{file | defines: defines, size: grown(file, section)})
    end
  end

  defp top([{:word, line, "define"} | _rest], _file),
    do: {:error, {line, "define is written: define new_name old_name ( … )"}}

  defp top([{:word, line, type}, {:mark, at, "("} | rest], file) do
    with {:ok, body, rest} <- body(rest, at, file.defines, 1) do
      section = expand(type, line, body, file.defines)
      top(rest, %{file | sections: [section | file.sections], size: grown(file, section)})
    end
  end

  defp top([{:word, line, name} | rest], file) do
    with {:ok, value, rest} <- value(rest, name, line, 1),
         do:
           top(rest, %{file | options: [{name, line, value} | file.options], size: file.size + 1})
  end

  defp top([{_kind, line, value} | _rest], _file),
    do: {:error, {line, "#{shown(value)} is not an option or a section"}}

  # The size of a section is counted only to limit definitions of definitions.
  defp plain(section),
    do: %{Map.delete(section, :size) | sections: Enum.map(section.sections, &plain/1)}

  defp grown(file, section), do: file.size + section.size

  defp body(tokens, at, defines, depth, done \\ %{options: [], sections: [], size: 1})

  defp body(_tokens, at, _defines, depth, _done) when depth > @deepest,
    do: {:error, {at, "nested more than #{@deepest} levels deep"}}

  defp body(_tokens, at, _defines, _depth, %{size: size}) when size > @most,
    do: {:error, {at, "more than #{@most} options, including those that define repeats"}}

  defp body([{:mark, _line, ")"} | rest], _at, _defines, _depth, done),
    do:
      {:ok, %{done | options: Enum.reverse(done.options), sections: Enum.reverse(done.sections)},
       rest}

  defp body([{:end, _line, nil}], at, _defines, _depth, _done),
    do: {:error, {at, "the ( here is never closed"}}

  defp body([{:word, line, type}, {:mark, inner_at, "("} | rest], at, defines, depth, done) do
    with {:ok, inner, rest} <- body(rest, inner_at, defines, depth + 1) do
      section = expand(type, line, inner, defines)
      done = %{done | sections: [section | done.sections], size: done.size + section.size}
      body(rest, at, defines, depth, done)
    end
  end

  defp body([{:word, line, name} | rest], at, defines, depth, done) do
    with {:ok, value, rest} <- value(rest, name, line, depth) do
      done = %{done | options: [{name, line, value} | done.options], size: done.size + 1}
      body(rest, at, defines, depth, done)
    end
  end

  defp body([{_kind, line, value} | _rest], _at, _defines, _depth, _done),
    do: {:error, {line, "#{shown(value)} is not the name of an option"}}

  @doc """
  The name of a section's driver: newer files have `driver ( name "rflex" … )`, older ones `position:0 ( driver "rflex" … )`.

      iex> {:ok, file} = Player.Sections.parse(~s|laser:0 ( driver "sicklms200" )|)
      iex> Enum.map(file.sections, &Player.Sections.driver/1)
      ["sicklms200"]
  """
  @spec driver(section()) :: String.t() | nil
  def driver(section), do: text(section, "name") || text(section, "driver")

  defp text(section, name) do
    case List.keyfind(section.options, name, 0) do
      {_name, _line, text} when is_binary(text) -> text
      _none -> nil
    end
  end

  # A section's own options win over those of its definition.
  defp expand(type, line, body, defines) do
    case defines do
      %{^type => old} ->
        own = MapSet.new(body.options, &elem(&1, 0))
        inherited = Enum.reject(old.options, &(elem(&1, 0) in own))

        %{
          type: old.type,
          line: line,
          options: inherited ++ body.options,
          sections: old.sections ++ body.sections,
          size: old.size + body.size
        }

      _none ->
        %{type: type, line: line, options: body.options, sections: body.sections, size: body.size}
    end
  end

  defp value([{kind, _line, value} | rest], _name, _at, _depth) when kind in [:number, :text],
    do: {:ok, value, rest}

  # Some files have words without quotes; a word on the next line is the next option.
  defp value([{:word, line, word} | rest], _name, line, _depth), do: {:ok, word, rest}

  defp value([{:mark, at, "["} | rest], _name, _line, depth), do: tuple(rest, at, depth + 1, [])

  defp value(_other, name, line, _depth), do: {:error, {line, "#{shown(name)} has no value"}}

  defp tuple(_tokens, at, depth, _done) when depth > @deepest,
    do: {:error, {at, "nested more than #{@deepest} levels deep"}}

  defp tuple([{:mark, _line, "]"} | rest], _at, _depth, done),
    do: {:ok, {:tuple, Enum.reverse(done)}, rest}

  defp tuple([{kind, _line, value} | rest], at, depth, done) when kind in [:number, :text, :word],
    do: tuple(rest, at, depth, [value | done])

  defp tuple([{:mark, inner, "["} | rest], at, depth, done) do
    with {:ok, value, rest} <- tuple(rest, inner, depth + 1, []),
         do: tuple(rest, at, depth, [value | done])
  end

  defp tuple(_other, at, _depth, _done), do: {:error, {at, "the [ here is never closed"}}

  defp shown(nil), do: "the end of the file"
  defp shown(text) when is_binary(text), do: String.slice(text, 0, 40)
  defp shown(number), do: to_string(number)
end
