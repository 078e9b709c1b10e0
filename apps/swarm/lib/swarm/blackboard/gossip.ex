defmodule Swarm.Blackboard.Gossip do
  @moduledoc "How a blackboard reaches other nodes: by a transport, `{m, f, a}`, that may be a test's."

  @type call :: {module(), atom(), list()}

  @doc """
  Terms to some nodes, one after the other, or to all. What does not go out, or gets lost, is repaired
  later.
  """
  @spec cast(call(), [node()] | :all, [term()]) :: :ok
  def cast({m, f, a}, nodes, terms) do
    to = if nodes == :all, do: [[]], else: Enum.map(nodes, &[&1])
    for to <- to, term <- terms, do: apply(m, f, a ++ [:rows | to] ++ [term])
    :ok
  end

  @doc "Some of the nodes, chosen at random."
  @spec some(call(), pos_integer(), :rand.state()) :: {[node()], :rand.state()}
  def some({m, f, a}, count, rand) do
    {drawn, rand} =
      Enum.map_reduce(apply(m, f, a), rand, fn node, rand ->
        {number, rand} = :rand.uniform_s(rand)
        {{number, node}, rand}
      end)

    {drawn |> Enum.sort() |> Enum.take(count) |> Enum.map(&elem(&1, 1)), rand}
  end
end
