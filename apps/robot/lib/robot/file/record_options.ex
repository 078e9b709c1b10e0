defmodule Robot.File.RecordOptions do
  @moduledoc "Lists the options of what records a robot: `record:` and `incidents:` of its file."
  alias Hal.Options

  @table [
    folder: [{:path, "the path of a folder"}, required: true],
    limit_mb: [{:integer, 4, 1_000_000, "MB"}, default: 500],
    pictures: [{:or, nil, {:number, 0.1, 5, "pictures a second"}}, default: nil]
  ]

  @incidents [
    folder: [{:path, "the path of a folder"}, required: true],
    limit_mb: [{:integer, 4, 1_000_000, "MB"}, default: 100],
    seconds: [{:integer, 10, 300, "s"}, default: 60]
  ]

  @doc "The table of the options of `record:`."
  @spec table() :: Options.table()
  def table, do: @table

  @doc "The table of the options of `incidents:`."
  @spec incidents() :: Options.table()
  def incidents, do: @incidents

  @doc "Checks the options of `incidents:` and adds the defaults; the error says what is wrong."
  @spec check_incidents(term()) :: {:ok, keyword()} | {:error, line :: String.t()}
  def check_incidents(options), do: Options.check(options, @incidents, "incidents")

  @doc """
  Checks the options and adds the defaults; the error says what is wrong.

      iex> Robot.File.RecordOptions.check(folder: "/tmp")
      {:ok, [limit_mb: 500, pictures: nil, folder: "/tmp"]}
      iex> Robot.File.RecordOptions.check(folder: "/tmp", limit_mb: 1)
      {:error, "record option limit_mb: expected a whole number from 4 to 1000000 MB, got 1"}
  """
  @spec check(term()) :: {:ok, keyword()} | {:error, line :: String.t()}
  def check(options), do: Options.check(options, @table, "record")

  @doc "Whether this user can write into a folder, or make it in the folder that it is in."
  @spec writable?(Path.t()) :: boolean()
  def writable?(folder) do
    case File.stat(folder) do
      {:error, :enoent} -> open?(File.stat(Path.dirname(folder)))
      stat -> open?(stat)
    end
  end

  defp open?({:ok, %File.Stat{type: :directory, access: access}}),
    do: access in [:write, :read_write]

  defp open?(_other), do: false
end
