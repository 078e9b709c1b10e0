defmodule Console.Cli.OutFile do
  @moduledoc """
  Writes a file that a person has asked for, whole or not at all.

  `check/2` comes before a long run, so that an unwritable place is known at once. `write/3` writes
  a new file beside the old one and renames it, so that a full disk leaves the old file, and no
  empty one. Devices and pipes are written directly.
  """

  @doc "Whether the file can be written now; the error names the option, the file and the reason."
  @spec check(option :: String.t(), Path.t() | nil) :: :ok | {:error, String.t()}
  def check(_option, path) when path in [nil, "-"], do: :ok

  def check(option, path) do
    case place(path) do
      {:new, part} -> explain(option, path, with(:ok <- File.touch(part), do: File.rm(part)))
      {:direct, :directory} -> explain(option, path, {:error, :eisdir})
      {:direct, _device} -> :ok
    end
  end

  @doc "Writes the file; the error names the option, if any, the file and the reason."
  @spec write(option :: String.t() | nil, Path.t(), iodata()) :: :ok | {:error, String.t()}
  def write(option \\ nil, path, content) do
    written =
      case place(path) do
        {:new, part} -> replace(part, path, content)
        {:direct, _device} -> File.write(path, content)
      end

    explain(option, path, written)
  end

  # A link to a file stays one: what it points to is replaced.
  defp place(path) do
    case File.stat(path) do
      {:ok, %File.Stat{type: :regular}} -> {:new, part(target(path))}
      {:error, _none} -> {:new, part(path)}
      {:ok, %File.Stat{type: type}} -> {:direct, type}
    end
  end

  # A name of this program's own: a file of the user's must not be taken for it.
  defp part(path), do: "#{path}.#{System.pid()}.part"

  defp target(path) do
    case File.read_link(path) do
      {:ok, link} -> link |> Path.expand(Path.dirname(path)) |> target()
      {:error, _no_link} -> path
    end
  end

  defp replace(part, path, content) do
    with :ok <- File.write(part, content, [:sync]),
         :ok <- File.rename(part, target(path)) do
      :ok
    else
      error ->
        _gone_already = File.rm(part)
        error
    end
  end

  defp explain(_option, _path, :ok), do: :ok

  defp explain(option, path, {:error, reason}),
    do:
      {:error,
       "#{option && option <> " "}#{path} cannot be written: #{:file.format_error(reason)}"}
end
