defmodule Swarm.Blackboard.Gossip do
  @moduledoc false
  # Sends from a blackboard to other nodes by a transport `{m, f, a}`, which a test may replace.

  @type call :: {module(), atom(), list()}

  @doc """
  Sends terms to some nodes, one after the other, or to all. What cannot be sent, or gets lost, is
  repaired later.
  """
  @spec cast(call(), [node()] | :all, [term()]) :: :ok
  def cast({m, f, a}, nodes, terms) do
    to = if nodes == :all, do: [[]], else: Enum.map(nodes, &[&1])
    for to <- to, term <- terms, do: apply(m, f, a ++ [:rows | to] ++ [term])
    :ok
  end

  @doc "Chooses some of the nodes at random."
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
