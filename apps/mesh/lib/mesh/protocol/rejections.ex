defmodule Mesh.Protocol.Rejections do
  @moduledoc """
  Counts what a node refuses, by reason, and in each second what nobody of the fleet has signed,
  by which `Mesh.Protocol.Packet.Filter` knows a flood. Pure.
  """
  alias Mesh.Protocol
  alias Mesh.Protocol.Packet
  alias Mesh.Protocol.Packet.ReplayProtection

  @doc "Time: each second begins to count anew what nobody of the fleet has signed."
  @spec tick(Protocol.t(), integer()) :: Protocol.t()
  def tick(protocol, now_ms), do: count(protocol, div(now_ms, 1_000))

  defp count(%{second: second} = protocol, second), do: protocol
  defp count(protocol, second), do: %{protocol | second: second, strange: 0}

  @doc """
  Counts a datagram that was refused. One of an unknown node is signed, so that is one of ours
  that somebody forgot to write down: it is told, once for each count of a hundred.
  """
  @spec reject(
          Protocol.t(),
          Packet.Filter.refusal() | ReplayProtection.refusal() | :unknown_node | :too_big,
          Protocol.address() | nil
        ) :: {Protocol.t(), [Protocol.effect()]}
  def reject(protocol, {:unknown_node, name}, address) do
    {protocol, effects} = reject(protocol, :unknown_node, address)

    if rem(protocol.rejected.unknown_node, 100) == 1,
      do: {protocol, [{:event, :unknown_node, %{name: name, address: address}} | effects]},
      else: {protocol, effects}
  end

  def reject(protocol, reason, _address) do
    strange = if reason in [:unsigned, :not_ours, :version], do: 1, else: 0
    rejected = Map.update(protocol.rejected, reason, 1, &(&1 + 1))
    {%{protocol | rejected: rejected, strange: protocol.strange + strange}, []}
  end
end
