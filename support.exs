Code.require_file("native.exs", __DIR__)
Code.require_file("packages.exs", __DIR__)

defmodule Mix.Tasks.Compile.Support do
  @shortdoc "Compiles what the tests of an app share"
  @moduledoc """
  The Mix compiler of an app's `test/support`, into the folder of the app's own modules, in tests only.

  If it were one of `elixirc_paths`, Mix would take what it has built for a release and what it builds for tests for
  two different things, and `bin/test` would have to compile the robot's apps twice.

  All of an app's is compiled again when one of its files, or anything that it may use, was touched: it is little.
  Modules that call each other in a circle are refused, as `mix xref` does it for `lib`, which does not see these.
  """
  use Mix.Task.Compiler

  @recursive true
  @folder "test/support"

  @impl Mix.Task.Compiler
  def run(arguments) do
    files = @folder |> Path.join("**/*.ex") |> Path.wildcard() |> Enum.sort()
    sources = for file <- files, do: {file, :erlang.md5(File.read!(file))}
    {before, modules} = made()

    cond do
      sources == [] and modules == [] ->
        {:noop, []}

      "--force" in arguments or sources != before or
          Mix.Utils.stale?([__ENV__.file | used()], [manifest()]) ->
        clean()
        compile(sources, "--warnings-as-errors" in arguments)

      true ->
        {:noop, []}
    end
  end

  @impl Mix.Task.Compiler
  def manifests, do: [manifest()]

  @impl Mix.Task.Compiler
  def clean do
    {_sources, modules} = made()

    for module <- modules do
      _none = File.rm(beam(module))
      :code.purge(module)
      :code.delete(module)
    end

    _none = File.rm(manifest())
    :ok
  end

  defp compile(sources, strict?) do
    Mix.shell().info("Compiling #{length(sources)} files of #{@folder}")

    files = for {file, _digest} <- sources, do: file
    ebin = Mix.Project.compile_path()

    case Kernel.ParallelCompiler.compile_to_path(files, ebin, return_diagnostics: true) do
      {:ok, modules, warnings} ->
        File.write!(manifest(), :erlang.term_to_binary({sources, modules}))
        judged(circles(modules), strict? and warned?(warnings))

      {:error, _errors, _warnings} ->
        {:error, []}
    end
  end

  defp judged([], false), do: {:ok, []}

  defp judged(circles, _warned?) do
    for circle <- circles,
        do: Mix.shell().error("modules call each other in a circle: #{Enum.join(circle, ", ")}")

    clean()
    {:error, []}
  end

  # Elixir 1.14 returns a list.
  defp warned?(%{compile_warnings: [], runtime_warnings: []}), do: false
  defp warned?(warnings), do: warnings != []

  # Those of one file count as one.
  defp circles(modules) do
    files = Map.new(modules, &{&1, file(&1)})
    graph = :digraph.new()
    for file <- Map.values(files), do: :digraph.add_vertex(graph, file)

    for {module, file} <- files,
        {other, _function, _arity} <- imports(module),
        is_map_key(files, other) and files[other] != file,
        do: :digraph.add_edge(graph, file, files[other])

    :digraph_utils.cyclic_strong_components(graph)
  end

  defp file(module), do: Path.relative_to_cwd("#{module.module_info(:compile)[:source]}")

  defp imports(module) do
    {:ok, {^module, [imports: imports]}} =
      module |> beam() |> to_charlist() |> :beam_lib.chunks([:imports])

    imports
  end

  # What was compiled before, and from which files.
  defp made do
    case File.read(manifest()) do
      {:ok, text} -> :erlang.binary_to_term(text)
      {:error, :enoent} -> {[], []}
    end
  end

  # The modules of this app, and of those that it depends on, are newer than this if they are not those that these
  # files were compiled with.
  defp used do
    others = Enum.map(Mix.Project.deps_paths(), &built/1)

    for path <-
          [Path.join(Mix.Project.manifest_path(), "compile.elixir")] ++
            for(folder <- others, name <- ~w(elixir support), do: "#{folder}/compile.#{name}"),
        File.exists?(path),
        do: path
  end

  defp built({app, _source}), do: Path.join([Mix.Project.build_path(), "lib", "#{app}", ".mix"])
  defp beam(module), do: Path.join(Mix.Project.compile_path(), "#{module}.beam")
  defp manifest, do: Path.join(Mix.Project.manifest_path(), "compile.support")
end

defmodule Convoy.Support do
  @moduledoc "What the projects of all apps of the umbrella say alike."

  @doc """
  The project of an app, with what it says of its own:

      def project, do: Convoy.Support.project(:lab, deps: [{:missions, in_umbrella: true}])

  Two words are ours: `native`, what of its C is built (`Mix.Tasks.Compile.Native`), and `packages`, those of others that it
  has adapters for (`Convoy.Packages.list/1`).
  """
  @spec project(atom(), keyword()) :: keyword()
  def project(app, own) do
    {packages, own} = Keyword.pop(own, :packages, [])
    native = if own[:native], do: [:native], else: []
    adapters = if packages != [], do: [:packages], else: []

    common = [
      app: app,
      version: "0.1.0",
      build_path: "../../_build",
      config_path: "../../config/config.exs",
      deps_path: "../../deps",
      lockfile: "../../mix.lock",
      elixir: "~> 1.14",
      compilers: compilers(native ++ adapters ++ Mix.compilers(), Mix.env()),
      # Files below `test` that are not tests, and that newer Mix shall not ask about.
      test_ignore_filters: [&String.starts_with?(&1, "test/support/")],
      start_permanent: Mix.env() == :prod
    ]

    common
    |> Keyword.merge(own)
    |> Keyword.put(:deps, Keyword.get(own, :deps, []) ++ Convoy.Packages.list(packages))
  end

  # What `support` makes is listed in the app's `.app`.
  defp compilers(all, :test),
    do: Enum.flat_map(all, &if(&1 == :app, do: [:support, :app], else: [&1]))

  defp compilers(all, _env), do: all
end
