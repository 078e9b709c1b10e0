defmodule Mcap.FileWriter.Disk do
  @moduledoc "Describes what `Mcap.FileWriter.Output` does with files; the error is one line that names the file."

  @type result :: :ok | {:error, line :: String.t()}

  @doc "Makes a file. One that is there already is not touched, or emptied if that is wanted."
  @spec create(Path.t(), overwrite? :: boolean()) ::
          {:ok, :file.io_device()} | {:error, line :: String.t()}
  def create(path, overwrite? \\ false) do
    modes = if overwrite?, do: [:write, :raw, :binary], else: [:write, :exclusive, :raw, :binary]
    named(:file.open(path, modes), path)
  end

  @doc "Writes all of this at the end of a file, which has `from` bytes, or nothing of it."
  @spec append(:file.io_device(), Path.t(), iodata(), from :: non_neg_integer()) :: result()
  def append(file, path, iodata, from) do
    with {:error, reason} <- :file.write(file, iodata) do
      # Else half a chunk would stay.
      _ = :file.position(file, from)
      _ = :file.truncate(file)
      named({:error, reason}, path)
    end
  end

  @doc "Closes a file."
  @spec close(:file.io_device(), Path.t()) :: result()
  def close(file, path), do: named(:file.close(file), path)

  @doc "Deletes a file. One that is gone already is deleted."
  @spec delete(Path.t()) :: result()
  def delete(path) do
    case File.rm(path) do
      {:error, reason} when reason != :enoent ->
        {:error, "#{path} cannot be deleted: #{:file.format_error(reason)}"}

      _gone ->
        :ok
    end
  end

  @doc "The same, with an error as a line."
  @spec named(ok, Path.t()) :: ok | {:error, line :: String.t()} when ok: term()
  def named({:error, :eexist}, path),
    do: {:error, "#{path} cannot be written: there is such a file already"}

  def named({:error, reason}, path),
    do: {:error, "#{path} cannot be written: #{:file.format_error(reason)}"}

  def named(ok, _path), do: ok
end
