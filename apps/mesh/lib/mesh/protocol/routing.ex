defmodule Mesh.Protocol.Routing do
  @moduledoc """
  How commands get to robots whose node this one does not hear: over nodes that hear both. Pure, from
  what is in the node table.
  """
  alias Mesh.Protocol.NodeTable

  @doc "The robots of nodes that are not heard here, but by others that are, sorted."
  @spec beyond(NodeTable.t(), integer()) :: [atom()]
  def beyond(node_table, now_ms) do
    {alive, silent} =
      Enum.split_with(node_table.nodes, fn {_name, entry} ->
        NodeTable.status(entry.heard_ms, now_ms) == :alive
      end)

    # Mostly nobody is silent, and then nothing has to be gone through.
    case for({name, %{robots: robots}} when robots != %{} <- silent, do: {name, robots}) do
      [] ->
        []

      silent ->
        heard = for {_name, %{hears: hears}} <- alive, name <- hears, into: MapSet.new(), do: name
        Enum.sort(for {name, robots} <- silent, name in heard, {id, _beat} <- robots, do: id)
    end
  end

  @doc """
  The connections of a node over which something gets on. One to a node that its own end does not hear
  is silent, though TCP may take a minute to say so.

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
  The connections over which something gets on now: those of the nodes that `me` hears, as `onward/1` gives them,
  and its own (`links`) to these.

      iex> Mesh.Protocol.Routing.ways(:a, [:b, :c], %{b: [:a, :c]})
      %{a: [:b], b: [:a, :c]}
  """
  @spec ways(name, links :: [name], %{name => [name]}) :: %{name => [name]} when name: term()
  def ways(me, links, alive), do: Map.put(alive, me, Enum.filter(links, &is_map_key(alive, &1)))
end
