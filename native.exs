defmodule Mix.Tasks.Compile.Native do
  @shortdoc "Builds the C parts of an app into its priv folder"
  @moduledoc """
  The Mix compiler of an app's C sources in `c_src/`. The project says what to build:

      native: [
        nifs: [blobs: ["blobs.c", "blobs_nif.c"]],          # priv/blobs.so
        programs: [newest_frame: ["newest_frame.c"]]        # priv/newest_frame
      ]

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
    headers = Path.wildcard("c_src/*.h")

    nifs =
      for {name, sources} <- native[:nifs] || [],
          do: {Path.join(priv, "#{name}.so"), sources, ~w(-shared -fPIC -I) ++ [erts_include()]}

    programs =
      for {name, sources} <- native[:programs] || [],
          do: {Path.join(priv, "#{name}"), sources, []}

    results = Enum.map(nifs ++ programs, &build(&1, headers))

    cond do
      :error in results -> {:error, []}
      :ok in results -> {:ok, []}
      true -> {:noop, []}
    end
  end

  defp build({target, sources, flags}, headers) do
    sources = Enum.map(sources, &Path.join("c_src", &1))

    if Mix.Utils.stale?(sources ++ headers ++ [__ENV__.file], [target]) do
      File.mkdir_p!(Path.dirname(target))
      arguments = @flags ++ flags ++ ["-o", target] ++ sources ++ ["-lm"]

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

  defp erts_include,
    do: Path.join([:code.root_dir(), "erts-#{:erlang.system_info(:version)}", "include"])
end
