defmodule Swarm.Mesh.Routing do
  @moduledoc """
  How commands get to robots whose node this one does not hear: over nodes that hear both. Pure, from
  what is in the book.
  """
  alias Swarm.Mesh.NodeTable

  @doc "The node that holds a robot, as far as anybody there was ever heard; of several the one heard last."
  @spec holder(NodeTable.t(), atom()) :: NodeTable.name() | nil
  def holder(book, id) do
    held = for {name, %{robots: %{^id => {at_ms, _, _}}}} <- book.nodes, do: {at_ms, name}
    if held != [], do: held |> Enum.max() |> elem(1)
  end

  @doc "The robots of nodes that are not heard here, but by others that are, sorted."
  @spec beyond(NodeTable.t(), integer()) :: [atom()]
  def beyond(book, now_ms) do
    alive = alive(book, now_ms)
    heard = Enum.uniq(for name <- alive, other <- book.nodes[name].hears, do: other)

    Enum.sort(
      for name <- heard -- [book.me | alive],
          %{robots: robots} <- [book.nodes[name]],
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
  def ways(book, links, now_ms) do
    alive = alive(book, now_ms)

    for name <- alive, entry = book.nodes[name], into: %{book.me => common(links, alive)} do
      {name, common(entry.links, entry.hears)}
    end
  end

  defp alive(book, now_ms), do: for({name, _address} <- NodeTable.hears(book, now_ms), do: name)
  defp common(links, heard), do: Enum.filter(links, &(&1 in heard))
end
