defmodule Swarm.Ether do
  @moduledoc """
  A network between processes of one VM that stand for several nodes: it loses and duplicates
  messages, and can be cut. Its transport is `{Swarm.Ether, :cast, [air, me, module]}`; `module`
  receives.
  """
  use Agent

  def start_link(nodes),
    do:
      Agent.start_link(fn ->
        %{nodes: nodes, loss: 0.0, doubled: 0.0, cut: [], largest: 0, sent: 0}
      end)

  def change(air, changes), do: Agent.update(air, &struct_like(&1, changes))
  def get(air), do: Agent.get(air, & &1)
  def others(air, me), do: List.delete(get(air).nodes, me)

  def cast(air, me, module, service, term) do
    for node <- others(air, me), do: cast(air, me, module, service, node, term)
    :ok
  end

  def cast(air, me, module, _service, node, term) do
    bytes = :erlang.term_to_binary(term)
    Agent.update(air, &%{&1 | largest: max(&1.largest, byte_size(bytes)), sent: &1.sent + 1})
    %{loss: loss, doubled: doubled, cut: cut} = get(air)
    copies = if :rand.uniform() < doubled, do: 2, else: 1

    for _ <- 1..copies,
        :rand.uniform() >= loss,
        {me, node} not in cut and {node, me} not in cut do
      module.hear(node, me, :erlang.binary_to_term(bytes, [:safe]))
    end

    :ok
  end

  defp struct_like(state, changes), do: Map.merge(state, Map.new(changes))
end
