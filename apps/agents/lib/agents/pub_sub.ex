defmodule Agents.PubSub do
  @moduledoc """
  Publishes events to the processes of one node, by either of two adapters: `Agents.PubSub.Local`, which is always
  available, or `Agents.PubSub.Phoenix`, where `phoenix_pubsub` is installed. `Agents.Topic` publishes between robots.

      children = [{Agents.PubSub.Local, name: Hall.Events}]
      bus = {Agents.PubSub.Local, Hall.Events}

      :ok = Agents.PubSub.subscribe(bus, "blobs:mag1")
      :ok = Agents.PubSub.broadcast(bus, "blobs:mag1", {:blobs, []})

  The process that starts a bus supervises it, and passes `{module, name}` to its users. Topics are text.
  Messages arrive unchanged; a process that subscribes twice gets them twice. A subscription ends
  with its process, or with the bus.
  """

  @type name :: atom()
  @type bus :: {module(), name()}
  @type topic :: String.t()

  @doc "The bus as a child. Option: `:name`."
  @callback child_spec(keyword()) :: Supervisor.child_spec()

  @doc "Subscribes the calling process to this topic."
  @callback subscribe(name(), topic()) :: :ok | {:error, :down}

  @doc "Ends all subscriptions of the calling process to this topic."
  @callback unsubscribe(name(), topic()) :: :ok | {:error, :down}

  @doc "Sends a message to all subscribers on this node."
  @callback broadcast(name(), topic(), message :: term()) :: :ok | {:error, :down}

  @doc "Subscribes the calling process. `{:error, :down}` if there is no such bus now."
  @spec subscribe(bus(), topic()) :: :ok | {:error, :down}
  def subscribe({module, name}, topic) when is_binary(topic), do: module.subscribe(name, topic)

  @doc "Ends all subscriptions of the calling process to a topic."
  @spec unsubscribe(bus(), topic()) :: :ok | {:error, :down}
  def unsubscribe({module, name}, topic) when is_binary(topic),
    do: module.unsubscribe(name, topic)

  @doc "Sends a message to all subscribers of a topic on this node."
  @spec broadcast(bus(), topic(), term()) :: :ok | {:error, :down}
  def broadcast({module, name}, topic, message) when is_binary(topic),
    do: module.broadcast(name, topic, message)
end
