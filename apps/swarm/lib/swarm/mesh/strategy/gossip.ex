defmodule Swarm.Mesh.Strategy.Gossip do
  @moduledoc """
  Beacons to a multicast group, once a second: for networks that carry multicast. Nothing needs to
  be configured; many Wi-Fi networks block it (`Swarm.Mesh.Strategy.Static`). Its option is the
  group's address and port.
  """
  @behaviour Swarm.Mesh.Strategy

  @every_ms 1_000

  @impl Swarm.Mesh.Strategy
  def init({{a, _, _, _}, port} = group) when a in 224..239 and port in 1..65_535,
    do: {:ok, %{group: group, due_ms: nil}}

  def init(other),
    do:
      {:error,
       "multicast is a group and a port such as {{239, 255, 67, 86}, 4371}, or false, not #{inspect(other)}"}

  @impl Swarm.Mesh.Strategy
  def targets(%{due_ms: due_ms} = state, _known, now_ms, _chance)
      when due_ms != nil and now_ms < due_ms,
      do: {[], state}

  def targets(state, _known, now_ms, _chance),
    do: {[state.group], %{state | due_ms: now_ms + @every_ms}}
end
