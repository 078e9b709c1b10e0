defmodule Convoy.Packages do
  @moduledoc """
  Which packages of others an app is built with. Nothing needs one: each has an adapter, which is compiled where its
  package is. A `mix.exs` names them with the versions that its adapters are written for:

      packages: [circuits_uart: "~> 1.5.5"]

  | `MIX_TARGET` | `CONVOY_DEPS` | packages |
  |---|---|---|
  | `host`, or not set | | none |
  | any other, such as `robot` | not set | all, from Hex |
  | any other | a folder | those whose sources lie in `FOLDER/NAME`, and Hex is never asked |

  What the folder's packages need themselves must lie there, too. A package that is not there, or that lacks something,
  is left out, and one line says so.
  """

  @doc "The dependencies of an app on these packages. `CONVOY_DEPS` that is no folder raises."
  @spec list(keyword(String.t())) :: [{atom(), String.t()}]
  def list(packages) do
    case {Mix.target(), System.get_env("CONVOY_DEPS", "")} do
      {:host, _folder} -> []
      {_target, ""} -> packages
      {_target, folder} -> Enum.filter(packages, &here?(&1, open(folder)))
    end
  end

  @doc "Why a package cannot be built from this folder, or `nil`."
  @spec lacks(atom(), Path.t()) :: String.t() | nil
  def lacks(name, folder), do: lacks([{name, nil}], folder, [])

  defp lacks([], _folder, _seen), do: nil

  defp lacks([{name, for} | rest], folder, seen) do
    file = Path.join([folder, "#{name}", "mix.exs"])

    cond do
      name in seen ->
        lacks(rest, folder, seen)

      File.regular?(file) ->
        lacks(Enum.map(needs(file), &{&1, name}) ++ rest, folder, [name | seen])

      for ->
        "#{for} needs #{name}, and there is no #{file}"

      true ->
        "there is no #{file}"
    end
  end

  # What a package always needs, read and not run: to run it, Mix would have to know all of this already. Whatever
  # is read too little here, Mix says when it looks.
  defp needs(file) do
    {_ast, needs} =
      file
      |> File.read!()
      |> Code.string_to_quoted!(file: file)
      |> Macro.prewalk([], fn
        {:{}, _, [name, version, options]} = node, needs when is_binary(version) ->
          {node, need(name, options) ++ needs}

        {name, version} = node, needs when is_atom(name) and is_binary(version) ->
          {node, if(dependency?(name, version), do: [name | needs], else: needs)}

        node, needs ->
          {node, needs}
      end)

    Enum.uniq(needs)
  end

  defp need(name, options) when is_atom(name) and is_list(options) do
    needed? =
      Keyword.keyword?(options) and options[:optional] != true and
        not Keyword.has_key?(options, :only)

    if needed?, do: [name], else: []
  end

  defp need(_name, _options), do: []

  # `version: "1.2.3"` is no dependency, `nx: "~> 0.6"` is one.
  defp dependency?(name, version),
    do: name not in [:version, :elixir] and String.match?(version, ~r/^(~>|>=|==) *\d/)

  defp here?({name, _version}, folder) do
    lacks = lacks(name, folder)
    if lacks, do: tell(name, lacks)
    lacks == nil
  end

  # Mix reads each mix.exs several times.
  defp tell(name, lacks) do
    unless Process.put({__MODULE__, name}, :told),
      do: IO.puts(:stderr, "packages: #{name} is left out: #{lacks}")
  end

  defp open(folder) do
    folder = Path.expand(folder, __DIR__)

    unless File.dir?(folder) do
      IO.puts(
        :stderr,
        "packages: CONVOY_DEPS=#{folder} is not a folder; one that holds the sources of packages is"
      )

      exit({:shutdown, 1})
    end

    Mix.SCM.prepend(Convoy.Packages.Folder)
    folder
  end
end

defmodule Convoy.Packages.Folder do
  @moduledoc """
  Where Mix finds dependencies that are named by their version only: in the folder `CONVOY_DEPS`, instead of Hex, for
  packages of packages too. They are built as `path:` dependencies are, and Mix checks their versions.
  """
  @behaviour Mix.SCM

  @impl Mix.SCM
  def accepts_options(app, options) do
    unless Enum.any?([:path, :in_umbrella, :git, :github], &options[&1]) do
      folder = Path.expand(System.fetch_env!("CONVOY_DEPS"), __DIR__)
      Keyword.put(options, :dest, Path.join(folder, "#{options[:hex] || app}"))
    end
  end

  @impl Mix.SCM
  def fetchable?, do: false

  @impl Mix.SCM
  def format(options), do: options[:dest]

  @impl Mix.SCM
  def format_lock(_options), do: nil

  @impl Mix.SCM
  def checked_out?(options), do: File.regular?(Path.join(options[:dest], "mix.exs"))

  @impl Mix.SCM
  def lock_status(_options), do: :ok

  @impl Mix.SCM
  def equal?(one, other), do: one[:dest] == other[:dest]

  @impl Mix.SCM
  def managers(_options), do: []

  @impl Mix.SCM
  def checkout(options),
    do: Mix.raise("#{options[:dest]} is missing; CONVOY_DEPS is where it is looked for")

  @impl Mix.SCM
  def update(options), do: checkout(options)
end

defmodule Mix.Tasks.Compile.Packages do
  @shortdoc "Compiles an app anew where other packages than before are there"
  @moduledoc """
  The Mix compiler that comes before Elixir's in apps with adapters. An adapter asks at compile time whether its package
  is there, and Mix does not see that the answer has changed.
  """
  use Mix.Task.Compiler

  @recursive true

  @impl Mix.Task.Compiler
  def run(_arguments) do
    deps = Mix.Project.config()[:deps]
    now = Enum.sort(for {name, version} when is_binary(version) <- deps, do: "#{name}")
    file = Path.join(Mix.Project.manifest_path(), "packages")

    case before(file) do
      ^now ->
        {:noop, []}

      before ->
        forget(before -- now)
        File.mkdir_p!(Path.dirname(file))
        File.write!(file, Enum.join(now, "\n"))
        {:ok, []}
    end
  end

  # What the compiler knows of other apps goes, too, or it would not know those of the packages. What was built of
  # packages that are gone would still be found; it is kept, since some take an hour to build.
  defp forget(gone) do
    Mix.Tasks.Compile.Elixir.clean()

    for old <- Path.wildcard(Path.join(Mix.Project.manifest_path(), "compile.*")),
        do: File.rm!(old)

    for name <- gone do
      ebin = Path.join([Mix.Project.build_path(), "lib", name, "ebin"])
      Code.delete_path(ebin)
    end
  end

  defp before(file) do
    case File.read(file) do
      {:ok, packages} -> String.split(packages)
      {:error, :enoent} -> []
    end
  end
end
