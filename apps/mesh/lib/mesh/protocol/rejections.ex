defmodule Mesh.Protocol.Rejections do
  @moduledoc false
  # Counts what a node refuses, by reason, and in each second datagrams from outside the fleet, by
  # which `Mesh.Protocol.Packet.Filter` knows a flood. Pure.
  alias Mesh.Protocol.Packet
  alias Mesh.Protocol.Packet.ReplayProtection

  # What any sender may send, and not only nodes of the fleet from their own addresses.
  @strange [:unsigned, :not_ours, :version, :foreign]

  @doc "Resets the count of non-members' datagrams each second."
  @spec tick(Mesh.Protocol.t(), integer()) :: Mesh.Protocol.t()
  def tick(protocol, now_ms), do: count(protocol, div(now_ms, 1_000))

  defp count(%{second: second} = protocol, second), do: protocol
  defp count(protocol, second), do: %{protocol | second: second, strange: 0}

  @doc """
  Counts a datagram that was refused. One of an unknown node is signed, so that is one of ours
  that a person forgot to write down: it is told, once for each count of a hundred. One that comes
  from a foreign address may have been changed by a router on the way: it is told at the first, the
  tenth, the hundredth, so that an attacker does not fill the log.
  """
  @spec reject(
          Mesh.Protocol.t(),
          Packet.Filter.refusal()
          | ReplayProtection.refusal()
          | {:foreign, String.t()}
          | :too_big,
          Mesh.Protocol.address() | nil
        ) :: {Mesh.Protocol.t(), [Mesh.Protocol.effect()]}
  def reject(protocol, {reason, name}, address) do
    {protocol, effects} = reject(protocol, reason, address)

    if told?(reason, protocol.rejected[reason]),
      do: {protocol, [{:event, reason, %{name: name, address: address}} | effects]},
      else: {protocol, effects}
  end

  def reject(protocol, reason, _address) do
    strange = if reason in @strange, do: 1, else: 0
    rejected = Map.update(protocol.rejected, reason, 1, &(&1 + 1))
    {%{protocol | rejected: rejected, strange: protocol.strange + strange}, []}
  end

  @doc "Counts a datagram of a session that is not known: a stranger may have recorded it."
  @spec strange(Mesh.Protocol.t()) :: Mesh.Protocol.t()
  def strange(protocol), do: %{protocol | strange: protocol.strange + 1}

  defp told?(:unknown_node, count), do: rem(count, 100) == 1
  defp told?(:foreign, 1), do: true
  defp told?(:foreign, count), do: rem(count, 10) == 0 and told?(:foreign, div(count, 10))
end
