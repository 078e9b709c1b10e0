defmodule Console.Tables do
  @moduledoc """
  Writes the tables of a run or of a recording (`Lab.Recording.Tables`) into a folder, row by row as it goes. An error is
  kept, and told by `close/1`.
  """
  alias Lab.Recording
  alias Sim.Scene

  @enforce_keys [:folder, :files]
  defstruct @enforce_keys ++ [told: 0, written: :ok]

  @type t :: %__MODULE__{
          folder: Path.t(),
          files: %{Recording.Tables.table() => :file.fd()},
          told: non_neg_integer(),
          written: :ok | {:error, String.t()}
        }

  @doc "Makes the folder and opens the tables in it; the error is one line."
  @spec open(Path.t()) :: {:ok, t()} | {:error, String.t()}
  def open(folder) do
    with :ok <- explain(folder, File.mkdir_p(folder)) do
      Enum.reduce_while(
        Recording.Tables.headers(),
        {:ok, %__MODULE__{folder: folder, files: %{}}},
        fn
          {table, header}, {:ok, tables} ->
            path = path(folder, table)

            case :file.open(path, [:write, :raw, :binary, :delayed_write]) do
              {:ok, file} ->
                tables = %{tables | files: Map.put(tables.files, table, file)}
                {:cont, {:ok, put(tables, table, header)}}

              error ->
                {:halt, explain(path, error)}
            end
        end
      )
    end
  end

  @doc "Writes the rows of a tick."
  @spec tick(t(), Recording.Facts.t(), Scene.t()) :: t()
  def tick(%__MODULE__{} = tables, facts, scene) do
    facts
    |> Recording.Tables.rows(scene, tables.told)
    |> Enum.reduce(tables, fn {table, rows}, tables -> put(tables, table, rows) end)
    |> Map.replace!(:told, length(scene.stages))
  end

  @doc "Ends the tables; the error says in one line what could not be written."
  @spec close(t()) :: :ok | {:error, String.t()}
  def close(%__MODULE__{} = tables) do
    closed =
      for {table, file} <- Enum.sort(tables.files),
          do: explain(path(tables.folder, table), :file.close(file))

    Enum.find([tables.written | closed], :ok, &(&1 != :ok))
  end

  defp put(%{written: :ok} = tables, table, bytes) do
    written = :file.write(tables.files[table], bytes)
    %{tables | written: explain(path(tables.folder, table), written)}
  end

  defp put(tables, _table, _bytes), do: tables

  defp path(folder, table), do: Path.join(folder, "#{table}.csv")

  defp explain(_path, :ok), do: :ok

  defp explain(path, {:error, reason}),
    do: {:error, "#{path} cannot be written: #{:file.format_error(reason)}"}
end
