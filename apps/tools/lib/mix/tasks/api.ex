defmodule Mix.Tasks.Api do
  @shortdoc "Writes the documentation of the public modules as HTML"
  @moduledoc """
  Writes the documentation of all modules that have one as HTML, to be read in a browser without a server.

      mix api [DIR]

  `index.html` lists the modules by app and room, in the order of `docs/modules.md`, and searches them; a module has a
  page. DIR is `doc` unless it is given; it is made, and pages of the same name are replaced. The same build gives the
  same bytes. Debian's `cmark-gfm` makes HTML of the Markdown.

  `--help` lists the options.

  Exit status: 0 if all is written, 1 if it could not be.
  """
  use Mix.Task
  alias Hal.Cli.Command

  @impl Mix.Task
  def run(arguments) do
    Command.run("api", arguments, {@moduledoc, []}, fn _options, words ->
      with {:ok, folder} <- folder(words),
           {:ok, count} <- Tools.Api.write(folder) do
        IO.puts("Wrote #{Path.join(folder, "index.html")} and pages of #{count} modules")
      else
        {:error, line} -> {:error, "api: #{line}"}
      end
    end)
  end

  defp folder([]), do: {:ok, "doc"}
  defp folder([folder]), do: {:ok, folder}
  defp folder(words), do: {:error, "expected one folder, got #{Enum.join(words, " ")}"}
end
