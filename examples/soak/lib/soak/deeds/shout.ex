defmodule Soak.Deeds.Shout do
  @moduledoc "Sends a stranger's datagrams to a node of a run, beside everything else."
  alias Lab.Node.Network
  alias Soak.State

  # Between so many datagrams of a flood others get their turn.
  @burst 200

  @doc "Begins to send them to a robot's node; where there is no stranger, nothing."
  @spec at(State.t(), robot :: atom(), Enumerable.t()) :: :ok
  def at(%{stranger: nil}, _robot, _datagrams), do: :ok

  def at(s, robot, datagrams) do
    {address, port} = Network.address(s.fleet.network, robot)

    spawn(fn ->
      for burst <- Stream.chunk_every(datagrams, @burst) do
        for datagram <- burst, do: _ = :gen_udp.send(s.stranger, address, port, datagram)

        receive do
        after
          10 -> :ok
        end
      end
    end)

    :ok
  end
end
