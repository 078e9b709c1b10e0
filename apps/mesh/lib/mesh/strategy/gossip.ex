defmodule Mesh.Strategy.Gossip do
  @moduledoc false
  # Sends beacons to a multicast group once a second, for networks that carry multicast. Nothing
  # needs to be configured; many Wi-Fi networks block it (`Mesh.Strategy.Static`). Its option is the
  # group's address and port.
  @behaviour Mesh.Strategy
  alias Hal.Options.Wording
  alias Mesh.Strategy.Static

  @every_ms 1_000

  @impl Mesh.Strategy
  def init(group) do
    case Static.address(group) do
      {:ok, {{a, _, _, _}, _port}} when a in 224..239 and is_tuple(group) ->
        {:ok, %{group: group, due_ms: nil}}

      _none ->
        group_of = "a group and a port such as {{239, 255, 67, 86}, 4371}, or false,"
        {:error, [{[], text}]} = Wording.refuse(group_of, group)
        {:error, "multicast: #{text}"}
    end
  end

  @impl Mesh.Strategy
  def targets(%{due_ms: due_ms} = state, _known, now_ms, _chance)
      when due_ms != nil and now_ms < due_ms,
      do: {[], state}

  def targets(state, _known, now_ms, _chance),
    do: {[state.group], %{state | due_ms: now_ms + @every_ms}}
end
