defmodule Mix.Tasks.Compile.Native do
  @shortdoc "Builds the C parts of an app into its priv folder"
  @moduledoc """
  The Mix compiler of an app's C sources in `c_src/`. The project (`Convoy.Support.project/2`) says what to build:

      native: [
        nifs: [blobs: ["blobs.c", "blobs_nif.c"]],          # priv/blobs.so
        programs: [newest_frame: ["newest_frame.c"]],       # priv/newest_frame
        optional: [marks: {"apriltag", "apriltag/apriltag.h", ["marks.c", "marks_nif.c"]}]
      ]

  An `optional` NIF is built with a library of the system, `-lapriltag` here, where its header is. Elsewhere it is left
  out without a word: its module says why it does nothing.

  Everything is compiled with `-Wall -Wextra -Werror`, and with `-ffp-contract=off`, so that
  floating-point results are the same on every machine and equal to the Elixir references.
  """
  use Mix.Task.Compiler

  @recursive true
  @flags ~w(-O3 -std=gnu11 -Wall -Wextra -Werror -ffp-contract=off -fno-math-errno)

  @impl Mix.Task.Compiler
  def run(_arguments) do
    native = Mix.Project.config()[:native] || []
    priv = Path.join(Mix.Project.app_path(), "priv")

    nifs =
      for {name, sources} <- native[:nifs] || [],
          do: {Path.join(priv, "#{name}.so"), sources, ~w(-shared -fPIC -I) ++ [erts_include()]}

    optional =
      for {name, {library, header, sources}} <- native[:optional] || [],
          target = Path.join(priv, "#{name}.so"),
          there?(header),
          do: {target, sources, ~w(-shared -fPIC -I) ++ [erts_include(), "-l#{library}"]}

    programs =
      for {name, sources} <- native[:programs] || [],
          do: {Path.join(priv, "#{name}"), sources, []}

    results = Enum.map(nifs ++ optional ++ programs, &build/1)

    cond do
      :error in results -> {:error, []}
      :ok in results -> {:ok, []}
      true -> {:noop, []}
    end
  end

  # A source may be another app's: "../../vision/c_src/blobs.c".
  defp build({target, sources, flags}) do
    sources = Enum.map(sources, &Path.join("c_src", &1))
    folders = sources |> Enum.map(&Path.dirname/1) |> Enum.uniq()
    headers = Enum.flat_map(folders, &Path.wildcard(Path.join(&1, "*.h")))

    if Mix.Utils.stale?(sources ++ headers ++ [__ENV__.file], [target]) do
      File.mkdir_p!(Path.dirname(target))
      {libraries, flags} = Enum.split_with(flags, &String.starts_with?(&1, "-l"))
      arguments = @flags ++ flags ++ ["-o", target] ++ sources ++ libraries ++ ["-lm"]

      case System.cmd("gcc", arguments, stderr_to_stdout: true) do
        {_output, 0} ->
          :ok

        {output, _status} ->
          Mix.shell().error(output)
          :error
      end
    else
      :noop
    end
  end

  # Where gcc looks for headers.
  defp there?(header) do
    question = ["-include", header, "-E", "-x", "c", "/dev/null"]
    match?({_source, 0}, System.cmd("gcc", question, stderr_to_stdout: true))
  end

  defp erts_include,
    do: Path.join([:code.root_dir(), "erts-#{:erlang.system_info(:version)}", "include"])
end
