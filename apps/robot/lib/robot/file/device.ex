defmodule Robot.File.Device do
  @moduledoc """
  The drivers that a robot file names, as `{Hal.RFlex.Driver, port: "/dev/ttyR0"}`.

  A driver is a module of this build with the callbacks of its kind. What options it takes it says
  itself, if it exports `options/1`: `{:ok, keyword} | {:error, line | [line]}`. Names in options are
  compared with the atoms that there are; a file makes none.
  """
  alias Hal.Suggest
  alias Robot.File.{Check, Reader}

  @kinds %{
    drive: {:drive, 2, "Hal.Drive"},
    ptz: {:look, 3, "Hal.Ptz"},
    camera: {:next, 1, "Hal.Camera"}
  }
  # Named here, so that their names are known before any of them is loaded.
  @ours %{
    drive: [Hal.RFlex.Driver],
    ptz: [Hal.Visca.Driver],
    camera: [Hal.Camera.FFmpeg]
  }

  @doc "The `{driver, options}` that a node names."
  @spec check(:drive | :ptz | :camera, Reader.tree(), [String.t()]) :: Check.result()
  def check(kind, {line, {:module, _name}} = module, path),
    do: check(kind, {line, {:tuple, [module, {line, {:list, []}}]}}, path)

  def check(kind, {line, {:tuple, [{_, {:module, name}} = module, {_at, options}]}} = node, path) do
    case options do
      {:keys, keys} -> driver(kind, module, name, keys, path)
      {:list, []} -> driver(kind, module, name, [], path)
      _other -> refuse(kind, {line, elem(node, 1)}, path)
    end
  end

  def check(kind, node, path), do: refuse(kind, node, path)

  defp refuse(kind, node, path) do
    [ours] = @ours[kind]
    Check.refuse("{driver, options} is allowed, such as {#{inspect(ours)}, […]}", node, path)
  end

  defp driver(kind, {line, _} = node, name, keys, path) do
    with {:ok, module} <- module(kind, name, node, path),
         {:ok, options} <- options(keys, path) do
      judge(module, options, line, path)
    end
  end

  defp module(kind, name, {line, _} = node, path) do
    {function, arity, behaviour} = @kinds[kind]
    ours = Enum.map(@ours[kind], &inspect/1)
    hint = with nil <- Suggest.nearest(name, ours), do: hd(ours)

    case existing("Elixir." <> name) do
      {:ok, module} ->
        cond do
          not Code.ensure_loaded?(module) ->
            {:error, [{line, path, "there is no #{name} in this build"}]}

          not function_exported?(module, function, arity) ->
            {:error, [{line, path, "#{name} is no #{behaviour}"}]}

          true ->
            {:ok, module}
        end

      :error ->
        hint = if hint == name, do: "", else: "; did you mean #{hint}?"
        Check.refuse("a driver of this build is allowed", node, path, hint)
    end
  end

  # Names that nobody has made cannot be an option of any driver.
  defp options(keys, path) do
    {known, unknown} = Enum.split_with(keys, &match?({:ok, _}, existing(elem(&1, 0))))

    strange =
      for {name, line, _node} <- unknown, do: {line, path ++ [name], "is an option of no driver"}

    twice =
      for {{name, line, _node}, n} <- Enum.with_index(keys),
          Enum.any?(Enum.take(keys, n), &(elem(&1, 0) == name)),
          do: {line, path ++ [name], "is given twice"}

    values =
      for {name, _line, node} <- known do
        {:ok, key} = existing(name)
        with {:ok, value} <- plain(node, path ++ [name]), do: {:ok, {key, value}}
      end

    case {strange ++ twice, Check.all(values)} do
      {[], result} -> result
      {problems, {:ok, _values}} -> {:error, problems}
      {problems, {:error, more}} -> {:error, problems ++ more}
    end
  end

  defp judge(module, options, line, path) do
    # Looked for at run time: a driver may have no such function.
    case function_exported?(module, :options, 1) && apply(module, :options, [options]) do
      {:error, lines} -> {:error, for(text <- List.wrap(lines), do: {line, path, text})}
      _well -> {:ok, {module, options}}
    end
  end

  defp plain({_line, {:list, nodes}}, path), do: all(nodes, path)

  defp plain({_line, {:tuple, nodes}}, path) do
    with {:ok, values} <- all(nodes, path), do: {:ok, List.to_tuple(values)}
  end

  defp plain({_line, {:keys, keys}}, path), do: options(keys, path)

  defp plain({_line, {:map, pairs}}, path) do
    results =
      for {key, value} <- pairs do
        with {:ok, [key, value]} <- all([key, value], path), do: {:ok, {key, value}}
      end

    with {:ok, pairs} <- Check.all(results), do: {:ok, Map.new(pairs)}
  end

  defp plain({_line, {:name, name}} = node, path), do: atom(name, node, path)
  defp plain({_line, {:module, name}} = node, path), do: atom("Elixir." <> name, node, path)
  defp plain({_line, value}, _path), do: {:ok, value}

  defp all(nodes, path), do: nodes |> Enum.map(&plain(&1, path)) |> Check.all()

  defp atom(name, node, path) do
    case existing(name) do
      {:ok, atom} -> {:ok, atom}
      :error -> Check.refuse("no driver knows such a name", node, path)
    end
  end

  defp existing(name) do
    {:ok, String.to_existing_atom(name)}
  rescue
    ArgumentError -> :error
  end
end
