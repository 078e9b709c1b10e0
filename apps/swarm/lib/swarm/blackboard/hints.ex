defmodule Swarm.Blackboard.Hints do
  @moduledoc """
  Hints that all robots share, on the blackboard of each node (`Swarm.Blackboard`): virtual stigmergy, such
  as "searched here".

      Swarm.Blackboard.Hints.put(:mag1, {:searched, 7}, %{x: 2.0, y: 1.0})
      Swarm.Blackboard.Hints.get({:searched, 7})           # on any node
      {:ok, %{x: 2.0, y: 1.0}, :mag1}
      Swarm.Blackboard.Hints.delete(:mag2, {:searched, 7})

  The last writer wins, decided by a count and not by a clock. A hint has at most 1,000 bytes, and
  there are at most 256 of them, including those deleted in the last ten minutes; the newest stay.
  They spread as rows do, and live as long as there is a node that has them.
  """
  alias Mesh.{Nonblocking, SafeTable}
  alias Swarm.Blackboard.{Codec, Rows}
  alias Swarm.Wire

  @board Swarm.Blackboard

  @doc "A robot writes a hint; the key is an atom or a pair such as `{:searched, 7}`. Errors are one line."
  @spec put(atom(), atom(), Codec.key(), term()) :: :ok | {:error, line :: String.t()}
  def put(board \\ @board, robot, key, value),
    do: write(board, robot, key, fn -> Codec.encode(key, value) end)

  @doc "A robot deletes a hint, its own or another's."
  @spec delete(atom(), atom(), Codec.key()) :: :ok | {:error, line :: String.t()}
  def delete(board \\ @board, robot, key), do: write(board, robot, key, fn -> "" end)

  defp write(board, robot, key, payload) do
    cond do
      not Wire.name?(robot) ->
        {:error, "#{inspect(robot)} is not a robot, which could write a hint"}

      not Codec.key?(key) ->
        {:error, "#{inspect(key)} is not a key of a hint; write a name or {:searched, 7}"}

      true ->
        request = {:hint, Atom.to_string(robot), key, payload.()}
        Nonblocking.call(board, request, "the blackboard of this node")
    end
  end

  @doc "A hint, and its writer."
  @spec get(atom(), Codec.key()) :: {:ok, term(), Codec.word()} | :error
  def get(board \\ @board, key) do
    with [row] <- SafeTable.lookup(board, {Rows.shown_as(), Codec.id(key)}),
         # Two keys may have the same number.
         [{^key, {value, writer}}] <- read(row),
         do: {:ok, value, writer},
         else: (_none -> :error)
  end

  @doc "All hints by key, each with its writer."
  @spec all(atom()) :: %{Codec.key() => {term(), Codec.word()}}
  def all(board \\ @board) do
    board
    |> SafeTable.select([{{{Rows.shown_as(), :_}, :_, :_, :_}, [], [:"$_"]}])
    |> Enum.flat_map(&read/1)
    |> Map.new()
  end

  # Skips deleted hints, and those with atoms that this node does not know.
  defp read({_id, payload, _at_ms, {_count, {writer, _check}}}) do
    for {:ok, key, value} <- [Codec.decode(payload)], do: {key, {value, Codec.word(writer)}}
  end
end
