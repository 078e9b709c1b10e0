defmodule Swarm.Mesh.Routing do
  @moduledoc """
  How commands get to robots whose node this one does not hear: over nodes that hear both. Pure, from
  what is in the node table.
  """
  alias Swarm.Mesh.NodeTable

  @doc "The node that holds a robot, as far as anybody there was ever heard; of several the one heard last."
  @spec holder(NodeTable.t(), atom()) :: NodeTable.name() | nil
  def holder(node_table, id) do
    held = for {name, %{robots: %{^id => {at_ms, _, _}}}} <- node_table.nodes, do: {at_ms, name}
    if held != [], do: held |> Enum.max() |> elem(1)
  end

  @doc "The robots of nodes that are not heard here, but by others that are, sorted."
  @spec beyond(NodeTable.t(), integer()) :: [atom()]
  def beyond(node_table, now_ms) do
    alive = alive(node_table, now_ms)
    heard = Enum.uniq(for name <- alive, other <- node_table.nodes[name].hears, do: other)

    Enum.sort(
      for name <- heard -- [node_table.me | alive],
          %{robots: robots} <- [node_table.nodes[name]],
          {id, _heard} <- robots,
          do: id
    )
  end

  @doc """
  The connections over which something gets on now, of this node (`links`) and of those it hears. One
  to a node that its own end does not hear is silent, though TCP may take a minute to say so.
  """
  @spec ways(NodeTable.t(), links :: [NodeTable.name()], integer()) :: %{
          NodeTable.name() => [NodeTable.name()]
        }
  def ways(node_table, links, now_ms) do
    alive = alive(node_table, now_ms)

    for name <- alive,
        entry = node_table.nodes[name],
        into: %{node_table.me => common(links, alive)} do
      {name, common(entry.links, entry.hears)}
    end
  end

  defp alive(node_table, now_ms),
    do: for({name, _address} <- NodeTable.hears(node_table, now_ms), do: name)

  defp common(links, heard), do: Enum.filter(links, &(&1 in heard))
end
