defmodule Mesh.Secret.File do
  @moduledoc "Reads the file of a secret, such as a fleet's, only if it is safe, and writes it for its owner alone."
  import Bitwise

  # The longest text that can be a good secret, including line ends, is far shorter.
  @most 8_192

  @doc """
  The text of a secret file, or what is wrong with the file, as the end of a sentence. A file that
  others than its owner may read or write is refused, and so is anything that is not a file.
  """
  @spec read(Path.t()) :: {:ok, String.t()} | {:error, String.t()}
  def read(path) do
    with {:ok, stat} <- stat(path),
         :ok <- check(stat) do
      text(path)
    end
  end

  defp stat(path) do
    if String.valid?(path) and not String.contains?(path, <<0>>),
      do: with({:error, reason} <- File.stat(path), do: {:error, problem(reason)}),
      else: {:error, "has no name that a file can have"}
  end

  defp check(%File.Stat{type: type}) when type != :regular, do: {:error, "is not a file"}
  defp check(%File.Stat{size: size}) when size > @most, do: {:error, "is far too long"}

  defp check(%File.Stat{mode: mode}) when (mode &&& 0o077) != 0,
    do: {:error, "may be read by others (mode #{octal(mode)}, must be 0600)"}

  defp check(_stat), do: :ok

  defp text(path) do
    case File.read(path) do
      {:ok, text} -> {:ok, text}
      {:error, reason} -> {:error, problem(reason)}
    end
  end

  @doc """
  Writes a text, mode 0600. Never overwrites anything unless forced, and then the old text stays
  until the new one is complete.
  """
  @spec write(Path.t(), String.t(), force? :: boolean()) :: :ok | {:error, String.t()}
  def write(path, text, force?) do
    target = if force?, do: path <> ".part", else: path
    if force?, do: File.rm(target)

    with :ok <- folder(path),
         # Created empty, closed to others, and only then filled.
         {:ok, file} <- :file.open(target, [:write, :exclusive, :raw, :binary]),
         :ok <- File.chmod(target, 0o600),
         :ok <- :file.write(file, text),
         :ok <- :file.sync(file),
         :ok <- :file.close(file),
         :ok <- if(force?, do: File.rename(target, path), else: :ok) do
      :ok
    else
      {:error, :eexist} -> {:error, "exists already; --force overwrites it"}
      {:error, reason} -> {:error, "cannot be written (#{:file.format_error(reason)})"}
    end
  end

  defp folder(path), do: path |> Path.dirname() |> File.mkdir_p()

  defp problem(:enoent), do: "does not exist"
  defp problem(reason), do: "cannot be read (#{:file.format_error(reason)})"

  defp octal(mode), do: "0" <> Integer.to_string(mode &&& 0o777, 8)
end
