defmodule Mesh.SafeTable do
  @moduledoc """
  Reads a named table of another process of this node, or writes to a public one, without calling it. The table
  disappears with that process, perhaps between two reads; a missing table reads as an empty one.
  """

  @doc """
  The rows of a key.

      iex> Mesh.SafeTable.lookup(:no_such_table, :key)
      []
  """
  @spec lookup(atom(), term()) :: [tuple()]
  def lookup(table, key) do
    :ets.lookup(table, key)
  rescue
    ArgumentError -> []
  end

  @doc """
  Writes rows; whether there was a table to write them to.

      iex> Mesh.SafeTable.insert(:no_such_table, [{:key, 1}])
      false
  """
  @spec insert(atom(), [tuple()]) :: boolean()
  def insert(table, rows) do
    :ets.insert(table, rows)
  rescue
    ArgumentError -> false
  end

  @doc "The results of a match specification, which is a constant of its caller."
  @spec select(atom(), :ets.match_spec()) :: [term()]
  def select(table, match) do
    :ets.select(table, match)
  rescue
    ArgumentError -> []
  end
end
