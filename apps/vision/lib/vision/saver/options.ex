defmodule Vision.Saver.Options do
  @moduledoc "Lists the options that people give to `Vision.Saver`, where they are explained. Pure."
  alias Hal.Options

  @table [
    folder: [{:path, "the path of a folder"}, required: true],
    rate: [{:number, 0.001, 30.0, "pictures a second"}, default: 1.0],
    files: [{:integer, 1, 100_000}, default: 1_000],
    megabytes: [{:integer, 1, 1_000_000}, default: 100]
  ]

  @doc "The table of the options."
  @spec table() :: Options.table()
  def table, do: @table

  @doc """
  Checks the options and adds the defaults; the error says what is wrong.

      iex> Vision.Saver.Options.check(folder: "/tmp")
      {:ok, [rate: 1.0, files: 1_000, megabytes: 100, folder: "/tmp"]}
      iex> Vision.Saver.Options.check(folder: "/tmp", files: 0)
      {:error, "saver option files: expected a whole number from 1 to 100000, got 0"}
  """
  @spec check(term()) :: {:ok, keyword()} | {:error, line :: String.t()}
  def check(options), do: Options.check(options, @table, "saver")
end
