defmodule Agents.PubSub.Local do
  @moduledoc "Publishes events on one node by a `Registry` (`Agents.PubSub`). Needs only Elixir."
  @behaviour Agents.PubSub

  @impl Agents.PubSub
  def child_spec(options) do
    [name: name] = Keyword.validate!(options, name: __MODULE__)
    # Partitioned by topic, so that each topic's subscribers are stored together.
    Registry.child_spec(keys: :duplicate, name: name, partitions: 1)
  end

  @impl Agents.PubSub
  def subscribe(name, topic), do: if_up(name, fn -> register(name, topic) end)

  @impl Agents.PubSub
  def unsubscribe(name, topic), do: if_up(name, fn -> Registry.unregister(name, topic) end)

  @impl Agents.PubSub
  def broadcast(name, topic, message) do
    if_up(name, fn ->
      Registry.dispatch(name, topic, &for({pid, nil} <- &1, do: send(pid, message)))
    end)
  end

  defp register(name, topic) do
    {:ok, _owner} = Registry.register(name, topic, nil)
    :ok
  end

  # A call raises if the registry does not run, also if it ends after this check.
  defp if_up(name, function),
    do: if(Process.whereis(name), do: function.(), else: {:error, :down})
end
