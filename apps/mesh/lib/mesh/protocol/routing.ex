defmodule Mesh.Protocol.Routing do
  @moduledoc false
  # Routes commands to robots on nodes that this one does not hear, through nodes that hear both.
  # Pure, computed from the node table.
  alias Mesh.Protocol.NodeTable

  @doc "The robots on nodes that are not heard here, but are heard by others that are, sorted."
  @spec beyond(NodeTable.t(), integer()) :: [atom()]
  def beyond(node_table, now_ms) do
    {alive, silent} =
      Enum.split_with(node_table.nodes, fn {_name, entry} ->
        NodeTable.status(entry.heard_ms, now_ms) == :alive
      end)

    # Usually no node is silent, and then nothing has to be searched.
    case for({name, %{robots: robots}} when robots != %{} <- silent, do: {name, robots}) do
      [] ->
        []

      silent ->
        heard = for {_name, %{hears: hears}} <- alive, name <- hears, into: MapSet.new(), do: name
        Enum.sort(for {name, robots} <- silent, name in heard, {id, _beat} <- robots, do: id)
    end
  end

  @doc """
  The working connections of a node. A connection to a node that it does not hear is silent,
  although TCP may take a minute to report that.

      iex> Mesh.Protocol.Routing.onward(%{links: ["b", "c"], hears: ["c", "d"]})
      ["c"]
  """
  @spec onward(%{
          required(:links) => [NodeTable.name()],
          required(:hears) => [NodeTable.name()],
          optional(any()) => any()
        }) :: [NodeTable.name()]
  def onward(%{links: links, hears: hears}), do: Enum.filter(links, &(&1 in hears))

  @doc """
  The connections that work now: those of the nodes that `me` hears, as `onward/1` returns them,
  and its own (`links`) to these.

      iex> Mesh.Protocol.Routing.ways(:a, [:b, :c], %{b: [:a, :c]})
      %{a: [:b], b: [:a, :c]}
  """
  @spec ways(name, links :: [name], %{name => [name]}) :: %{name => [name]} when name: term()
  def ways(me, links, alive), do: Map.put(alive, me, Enum.filter(links, &is_map_key(alive, &1)))
end
