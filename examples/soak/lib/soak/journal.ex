defmodule Soak.Journal do
  @moduledoc "Writes each disturbance into a file with its time, as it happens."

  @doc "Opens a new file."
  @spec open(Path.t()) :: :file.io_device()
  def open(path) do
    File.mkdir_p!(Path.dirname(path))
    {:ok, file} = :file.open(path, [:write, :raw])
    file
  end

  @doc "Writes a line, so many milliseconds after the start of the run."
  @spec write(:file.io_device(), non_neg_integer(), String.t()) :: :ok
  def write(file, at_ms, words), do: :file.write(file, line(at_ms, words) <> "\n")

  @doc """
  Such a line.

      iex> Soak.Journal.line(62_345, "mag1 is up")
      "   62.345 s  mag1 is up"
  """
  @spec line(non_neg_integer(), String.t()) :: String.t()
  def line(at_ms, words) do
    seconds = :erlang.float_to_binary(at_ms / 1000, decimals: 3)
    String.pad_leading(seconds, 9) <> " s  " <> words
  end

  @doc "Closes it."
  @spec close(:file.io_device()) :: :ok
  def close(file), do: :file.close(file)
end
