defmodule Mix.Tasks.Fleet.Certs do
  @shortdoc "Makes the certificates of a fleet's robots"
  @moduledoc """
  Creates a fleet's CA, unless there is one, and for each robot a key, a certificate signed by
  that CA, and the options of Erlang's distribution by TLS. `docs/security.md` says how to use
  them.

      mix fleet.certs mag1 mag2 min1 [--out DIR]
      mix fleet.certs --fleet FILE

  Existing files are kept: to add a robot later, run it again with its name. Needs `openssl`.

  `--help` lists the options.
  """
  use Mix.Task
  alias Hal.Cli.Command
  alias Mesh.Distribution.Certs

  @options [
    {"fleet", "FILE", &Hal.Cli.Parse.text/1,
     "the names of robots, one per line; # begins a comment"},
    {"out", "DIR", &Hal.Cli.Parse.text/1,
     "the folder (certs, which git ignores); copy DIR/mag1 to mag1, and\nkeep DIR/ca-key.pem to yourself"},
    {"force", nil, nil, "make new keys and certificates for these robots; never a new CA"}
  ]
  @longest 65_536

  @impl Mix.Task
  def run(words), do: Command.run("fleet.certs", words, {@moduledoc, @options}, &certs/2)

  defp certs(given, names) do
    options = Map.new(given)

    with {:ok, more} <- listed(options["fleet"]),
         {:ok, names} <- check(Enum.uniq(names ++ more)),
         folder = options["out"] || "certs",
         {:ok, ca} <- Certs.ca(folder) do
      tell("#{folder}/ca.pem", ca)
      Enum.find_value(names, :ok, &robot(folder, &1, options["force"] || false))
    end
  end

  defp robot(folder, name, force?) do
    with {:ok, done} <- Certs.robot(folder, name, force?) do
      tell("#{folder}/#{name}", done)
      nil
    end
  end

  defp listed(nil), do: {:ok, []}

  defp listed(path) do
    with {:ok, %File.Stat{type: :regular, size: size}} when size <= @longest <- File.stat(path),
         {:ok, text} <- File.read(path) do
      lines = for line <- String.split(text, ["\n", "\r"]), do: hd(String.split(line, "#"))
      {:ok, Enum.flat_map(lines, &String.split/1)}
    else
      {:ok, _other} -> {:error, "--fleet #{path} is not a file of names"}
      {:error, why} -> {:error, "--fleet #{path} cannot be read: #{:file.format_error(why)}"}
    end
  end

  defp check([]), do: {:error, "robots are missing: give their names, or --fleet FILE"}

  defp check(names) do
    case Enum.reject(names, &Certs.name?/1) do
      [] -> {:ok, names}
      [wrong | _] -> {:error, "#{inspect(wrong)} is not a robot's name; names are as mag1"}
    end
  end

  defp tell(path, done), do: Mix.shell().info("#{path} #{done}")
end
