defmodule Robot.File.Options do
  @moduledoc """
  The options of a driver, of what `Robot.File.Reader` read. Names become the atoms that there are; a
  name that nobody has made cannot be an option of any driver. Pure.
  """
  alias Robot.File.{Check, Reader}

  @doc """
  The options that these keys are; `allowed` are the names that the driver knows, each with those of the
  keys below it, or nothing, if it does not tell: then all names that there are.
  """
  @spec read([{String.t(), pos_integer(), Reader.tree()}], [String.t()], %{atom() => map()}) ::
          Check.result()
  def read(keys, path, allowed) do
    names = Map.keys(allowed)

    strange =
      for {name, line, _node} <- keys, not option?(name, names) do
        {line, path ++ [name],
         "is not an option#{Check.meant(name, names, "")}#{choice(name, names)}"}
      end

    twice =
      for {{name, line, _node}, n} <- Enum.with_index(keys),
          Enum.any?(Enum.take(keys, n), &(elem(&1, 0) == name)),
          do: {line, path ++ [name], "is given twice"}

    values =
      for {name, _line, node} <- keys, {:ok, key} <- [existing(name)] do
        below = Map.get(allowed, key, %{})
        with {:ok, value} <- plain(node, path ++ [name], below), do: {:ok, {key, value}}
      end

    case {strange ++ twice, Check.all(values)} do
      {[], result} -> result
      {problems, {:ok, _values}} -> {:error, problems}
      {problems, {:error, more}} -> {:error, problems ++ more}
    end
  end

  defp option?(name, []), do: existing(name) != :error
  defp option?(name, names), do: Enum.any?(names, &(Atom.to_string(&1) == name))

  defp choice(_name, []), do: " of any driver"

  defp choice(name, names) do
    if Check.meant(name, names, "") == "",
      do: ": there are #{names |> Enum.sort() |> Enum.join(", ")}",
      else: ""
  end

  defp plain({_line, {:list, nodes}}, path, _below), do: all(nodes, path)

  defp plain({_line, {:tuple, nodes}}, path, _below) do
    with {:ok, values} <- all(nodes, path), do: {:ok, List.to_tuple(values)}
  end

  defp plain({_line, {:keys, keys}}, path, below), do: read(keys, path, below)

  defp plain({_line, {:map, pairs}}, path, _below) do
    results =
      for {key, value} <- pairs do
        with {:ok, [key, value]} <- all([key, value], path), do: {:ok, {key, value}}
      end

    with {:ok, pairs} <- Check.all(results), do: {:ok, Map.new(pairs)}
  end

  defp plain({_line, {:name, name}} = node, path, _below), do: atom(name, node, path)

  defp plain({_line, {:module, name}} = node, path, _below),
    do: atom("Elixir." <> name, node, path)

  defp plain({_line, value}, _path, _below), do: {:ok, value}

  defp all(nodes, path), do: nodes |> Enum.map(&plain(&1, path, %{})) |> Check.all()

  defp atom(name, node, path) do
    case existing(name) do
      {:ok, atom} -> {:ok, atom}
      :error -> Check.refuse("no driver knows such a name", node, path)
    end
  end

  @doc """
  The atom of a name, if there is one; none is made.

      iex> Robot.File.Options.existing("magellan")
      {:ok, :magellan}
      iex> Robot.File.Options.existing("no such name as this")
      :error
  """
  @spec existing(String.t()) :: {:ok, atom()} | :error
  def existing(name) do
    {:ok, String.to_existing_atom(name)}
  rescue
    ArgumentError -> :error
  end
end
