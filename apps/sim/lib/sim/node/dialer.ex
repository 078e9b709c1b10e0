defmodule Sim.Node.Dialer do
  @moduledoc """
  Keeps this node connected with others, for ever: a process for each, since a call to one that is
  frozen takes seconds. Of two nodes the one whose name comes first dials.
  """

  @retry_ms 200

  @doc "Dials those whose names come after ours."
  @spec start([node()]) :: [pid()]
  def start(nodes), do: for(other <- nodes, node() < other, do: spawn_link(fn -> dial(other) end))

  defp dial(other) do
    if other not in Node.list(), do: Node.connect(other)

    receive do
    after
      @retry_ms -> dial(other)
    end
  end
end
