if Code.ensure_loaded?(Phoenix.PubSub) do
  defmodule Agents.PubSub.Phoenix do
    @moduledoc """
    Publishes events on one node by `Phoenix.PubSub` (`Agents.PubSub`), for programs that use it anyway. Nothing is sent
    to other nodes, because a slow connection between robots must not delay others.
    """
    @behaviour Agents.PubSub

    @impl Agents.PubSub
    def child_spec(options) do
      [name: name] = Keyword.validate!(options, name: __MODULE__)
      Phoenix.PubSub.child_spec(name: name)
    end

    @impl Agents.PubSub
    def subscribe(name, topic), do: if_up(name, fn -> Phoenix.PubSub.subscribe(name, topic) end)

    @impl Agents.PubSub
    def unsubscribe(name, topic),
      do: if_up(name, fn -> Phoenix.PubSub.unsubscribe(name, topic) end)

    @impl Agents.PubSub
    def broadcast(name, topic, message),
      do: if_up(name, fn -> Phoenix.PubSub.local_broadcast(name, topic, message) end)

    defp if_up(name, function),
      do: if(Process.whereis(name), do: function.(), else: {:error, :down})
  end
end
