defmodule Mix.Tasks.Fleet.Secret do
  @shortdoc "Makes the secret of a fleet"
  @moduledoc """
  Creates the secret of a fleet: a small text file of 32 random bytes, readable by its owner only
  (mode 0600). Copy it to every robot, and nowhere else; `docs/security.md` says how.

      mix fleet.secret [FILE] [--force]

  FILE is `convoy.secret` in the current folder by default, which git ignores.

  `--help` lists the options.
  """
  use Mix.Task
  alias Mesh.Secret

  @options [{"force", nil, nil, "overwrite an existing file; every robot then needs the new one"}]

  @impl Mix.Task
  def run(words),
    do: Hal.Cli.Command.run("fleet.secret", words, {@moduledoc, @options}, &make/2)

  defp make(_options, [_, _ | _] = files),
    do: {:error, "one file, not #{length(files)}: #{Enum.join(files, " ")}"}

  defp make(given, files) do
    path = List.first(files) || Secret.default_path()

    with {:ok, secret} <- Secret.create(path, given != []),
         do:
           Mix.shell().info(
             "#{path} made, fingerprint #{secret.fingerprint}; copy it to every robot"
           )
  end
end
