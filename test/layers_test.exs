defmodule System.LayersTest do
  @moduledoc "Inside an app, rooms name only those that docs/modules.md has before them; names mean one thing."
  use ExUnit.Case, async: true
  alias Tools.Api.Rooms
  @root Path.expand("..", __DIR__)

  # Calls at run time.
  defp calls(module) do
    {^module, beam, _path} = :code.get_object_code(module)
    {:ok, {^module, [imports: imports]}} = :beam_lib.chunks(beam, [:imports])
    for {called, _f, _a} <- imports, uniq: true, do: called
  end

  # Modules that a source names: in calls, captures, structs, `{module, function, arguments}` and options. Types, which the
  # compiler does not need, and documents do not count.
  defp named_in(file) do
    {:ok, ast} = file |> File.read!() |> Code.string_to_quoted()
    {_ast, {_aliases, named}} = Macro.traverse(ast, {%{}, []}, &enter/2, &{&1, &2})
    Enum.uniq(named)
  end

  @words [:moduledoc, :doc, :typedoc, :spec, :type, :typep, :opaque, :callback, :macrocallback]

  defp enter({:@, _, [{word, _, _}]}, seen) when word in @words, do: {nil, seen}

  defp enter({:alias, _, [{{:., _, [base, :{}]}, _, paths}]}, {aliases, named}) do
    base = full(base, aliases)
    added = for {:__aliases__, _, path} <- paths, do: {List.last(path), base ++ path}
    {nil, {Map.merge(aliases, Map.new(added)), named}}
  end

  defp enter({:alias, _, [{:__aliases__, _, path} = module | options]}, {aliases, named}) do
    name =
      case options do
        [[as: {:__aliases__, _, [name]}]] -> name
        _none -> List.last(path)
      end

    {nil, {Map.put(aliases, name, full(module, aliases)), named}}
  end

  defp enter({:__aliases__, _, [first | _]} = module, {aliases, named} = seen) do
    if is_atom(first),
      do: {nil, {aliases, [Module.concat(full(module, aliases)) | named]}},
      else: {nil, seen}
  end

  defp enter(other, seen), do: {other, seen}

  defp full({:__aliases__, _, [first | rest]}, aliases),
    do: Map.get(aliases, first, [first]) ++ rest

  test "each room names those before it" do
    layers = @root |> Path.join("docs/modules.md") |> File.read!() |> Rooms.table()
    assert length(layers) >= 5

    wrong =
      for {app, rooms} <- layers do
        {:ok, modules} = :application.get_key(app, :modules)
        place = rooms |> Enum.with_index() |> Map.new()

        homes =
          for module <- modules,
              home = Rooms.room(app, module),
              home not in ["", "mix"],
              into: %{},
              do: {module, home}

        assert {app, Enum.sort(Enum.uniq(Map.values(homes))) -- rooms} == {app, []}

        for {module, home} <- homes,
            named <- named_in("#{module.module_info(:compile)[:source]}"),
            other = homes[named],
            place[other] > place[home],
            do: {app, module, named}
      end

    assert wrong |> Enum.concat() |> Enum.sort() == []
  end

  test "what has no moduledoc is called by its own app alone" do
    owners =
      for {app, _description, _version} <- Application.loaded_applications(),
          File.dir?(Path.join([@root, "apps", "#{app}"])),
          {:ok, modules} = :application.get_key(app, :modules),
          module <- modules,
          into: %{},
          do: {module, app}

    hidden =
      for {module, _app} <- owners,
          match?({:docs_v1, _, _, _, :hidden, _, _}, Code.fetch_docs(module)),
          into: MapSet.new(),
          do: module

    assert MapSet.size(hidden) > 200

    assert for(
             {module, app} <- owners,
             called <- calls(module),
             called in hidden and owners[called] != app,
             do: {module, called}
           ) == []
  end

  # The last names of all aliases of a file, with their lines.
  defp aliases(file) do
    {_ast, names} =
      file
      |> File.read!()
      |> Code.string_to_quoted!()
      |> Macro.prewalk([], &{&1, named(&1) ++ &2})

    for {line, name} <- names, do: {name, "#{Path.relative_to(file, @root)}:#{line}"}
  end

  defp named({:alias, meta, [{:__aliases__, _, _path}, [as: {:__aliases__, _, [name]}]]}),
    do: [{meta[:line], name}]

  defp named({:alias, meta, [{:__aliases__, _, [_first, _second | _] = path}]}),
    do: [{meta[:line], List.last(path)}]

  defp named({:alias, meta, [{{:., _, [_base, :{}]}, _, paths}]}),
    do: for({:__aliases__, _, path} <- paths, do: {meta[:line], List.last(path)})

  defp named(_other), do: []

  test "no alias hides a module of Elixir" do
    {:ok, modules} = :application.get_key(:elixir, :modules)

    # `Behaviour` may be gone from Elixir, but means what is Elixir's to a reader.
    taken =
      for module <- [Behaviour, EEx, ExUnit, IEx, Logger, Mix | modules],
          ["Elixir", name] <- [module |> Atom.to_string() |> String.split(".")],
          into: MapSet.new(),
          do: String.to_atom(name)

    files =
      for place <- ~w(apps/*/lib apps/*/test test examples config),
          file <- Path.wildcard(Path.join([@root, place, "**/*.{ex,exs}"])),
          do: file

    assert length(files) > 100

    assert for(file <- files, {name, where} <- aliases(file), name in taken, do: {where, name}) ==
             []
  end
end
