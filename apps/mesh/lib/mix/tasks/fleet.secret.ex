defmodule Mix.Tasks.Fleet.Secret do
  @shortdoc "Makes the secret of a fleet"
  @moduledoc """
  Creates the secret of a fleet: a small text file of 32 random bytes, readable by its owner only
  (mode 0600). Copy it to every robot, and nowhere else; `docs/security.md` says how.

      mix fleet.secret [FILE] [--force]

  FILE is `convoy.secret` in the current folder by default, which git ignores.

  Options:

    * `--force` - overwrite an existing file; every robot then needs the new one
    * `--help` - this text
  """
  use Mix.Task
  alias Mesh.Secret

  @impl Mix.Task
  def run(words), do: Hal.CommandOutput.run("fleet.secret", fn -> command(words) end)

  defp command(words) do
    case OptionParser.parse(words, strict: [force: :boolean, help: :boolean]) do
      {_options, _files, [{word, _value} | _]} ->
        refuse("#{word} is not an option; --help lists them")

      {options, files, []} ->
        run(options, files)
    end
  end

  defp run(options, files) do
    cond do
      options[:help] -> Mix.shell().info(@moduledoc)
      length(files) > 1 -> refuse("one file, not #{length(files)}: #{Enum.join(files, " ")}")
      true -> make(List.first(files) || Secret.default_path(), options[:force] || false)
    end
  end

  defp make(path, force?) do
    case Secret.create(path, force?) do
      {:ok, secret} ->
        Mix.shell().info(
          "#{path} made, fingerprint #{secret.fingerprint}; copy it to every robot"
        )

      {:error, line} ->
        refuse(line)
    end
  end

  defp refuse(line) do
    Mix.shell().error(line)
    exit({:shutdown, 1})
  end
end
