defmodule Mcap.Reader.Source do
  @moduledoc false
  # Reads parts of an open file. A length that the file claims is believed only as far as the file is long, and up to 256
  # MiB.

  @most 0x1000_0000

  @enforce_keys [:file, :size]
  defstruct @enforce_keys

  @opaque t :: %__MODULE__{file: :file.io_device(), size: non_neg_integer()}

  @doc "Opens a file for reading by this process. Only regular files: others may never answer."
  @spec open(Path.t()) :: {:ok, t()} | {:error, line :: String.t()}
  def open(path) do
    with {:ok, %{type: :regular, size: size}} <- File.stat(path),
         {:ok, file} <- :file.open(path, [:read, :raw, :binary]) do
      {:ok, %__MODULE__{file: file, size: size}}
    else
      {:ok, %{type: type}} -> {:error, "#{path} cannot be read: it is a #{type}, not a file"}
      {:error, reason} -> {:error, "#{path} cannot be read: #{:file.format_error(reason)}"}
    end
  end

  @doc "Closes it."
  @spec close(t()) :: :ok
  def close(source) do
    _ = :file.close(source.file)
    :ok
  end

  @doc "How many bytes the file had when it was opened."
  @spec size(t()) :: non_neg_integer()
  def size(source), do: source.size

  @doc "So many bytes from an offset on, or `:error` if the file does not have them."
  @spec read(t(), non_neg_integer(), non_neg_integer()) :: {:ok, binary()} | :error
  def read(_source, _offset, 0), do: {:ok, <<>>}

  def read(%{size: size} = source, offset, length)
      when length <= @most and offset + length <= size do
    case :file.pread(source.file, offset, length) do
      {:ok, bytes} when byte_size(bytes) == length -> {:ok, bytes}
      _shorter -> :error
    end
  end

  def read(_source, _offset, _length), do: :error

  @doc "The content of the record at an offset that has this opcode and, with its head of 9 bytes, this length."
  @spec record(t(), byte(), non_neg_integer(), non_neg_integer()) :: {:ok, binary()} | :error
  def record(source, opcode, offset, length) do
    with {:ok, <<^opcode, n::little-64, content::binary>>} <- read(source, offset, length),
         true <- n == byte_size(content) do
      {:ok, content}
    else
      _no -> :error
    end
  end

  @doc "Opcode and length of the record at an offset, if the whole record is in the file."
  @spec head(t(), non_neg_integer()) :: {:ok, byte(), length :: non_neg_integer()} | :error
  def head(source, offset) do
    with {:ok, <<opcode, n::little-64>>} <- read(source, offset, 9),
         true <- opcode > 0 and offset + 9 + n <= source.size do
      {:ok, opcode, n + 9}
    else
      _no -> :error
    end
  end
end
