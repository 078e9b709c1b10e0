defmodule Agents.Topic.Subscription do
  @moduledoc false
  # Joins the topic's group for its owner, which gets one envelope for each that it asks for.
  use GenServer
  alias Agents.{Envelope, Mailbox, Template}
  alias Swarm.Directory

  @spec start_link(pid(), Envelope.topic(), pos_integer(), Template.t()) :: GenServer.on_start()
  def start_link(owner, topic, limit, template),
    do: GenServer.start_link(__MODULE__, {owner, topic, limit, template})

  @impl GenServer
  def init({owner, topic, limit, template}) do
    # A link alone would not end it when its owner ends normally.
    Process.monitor(owner)

    {:ok,
     %{
       owner: owner,
       mailbox: Mailbox.new(limit),
       template: template,
       asked: 0,
       rejected: 0,
       unwanted: 0,
       entry: Directory.Membership.enter([{:topic, topic}])
     }}
  end

  @impl GenServer
  def handle_call(:take_back, {owner, _tag}, %{owner: owner} = s),
    do: {:reply, :ok, %{s | asked: max(s.asked - 1, 0)}}

  def handle_call(:counts, _from, s) do
    counts = Map.merge(s.mailbox.dropped, %{rejected: s.rejected, unwanted: s.unwanted})
    {:reply, Map.put(counts, :waiting, Mailbox.size(s.mailbox)), s}
  end

  def handle_call(_unknown, _from, s), do: {:noreply, s}

  @impl GenServer
  def handle_cast({:more, owner}, %{owner: owner} = s),
    do: {:noreply, hand_over(%{s | asked: s.asked + 1})}

  def handle_cast({:unsubscribe, owner}, %{owner: owner} = s), do: {:stop, :normal, s}
  def handle_cast(_unknown, s), do: {:noreply, s}

  @impl GenServer
  def handle_info({:DOWN, _monitor, :process, owner, _reason}, %{owner: owner} = s),
    do: {:stop, :normal, s}

  def handle_info(%{__struct__: Envelope} = message, s) do
    with {:ok, envelope} <- Envelope.check(message),
         true <- Template.match?(s.template, envelope) do
      {:noreply, hand_over(%{s | mailbox: Mailbox.put(s.mailbox, envelope)})}
    else
      {:error, _field} -> {:noreply, %{s | rejected: s.rejected + 1}}
      false -> {:noreply, %{s | unwanted: s.unwanted + 1}}
    end
  end

  def handle_info(message, s) do
    case Directory.Membership.arrived(s.entry, message) do
      {:ok, entry} -> {:noreply, %{s | entry: entry}}
      :other -> {:noreply, %{s | rejected: s.rejected + 1}}
    end
  end

  defp hand_over(%{asked: 0} = s), do: s

  defp hand_over(s) do
    case Mailbox.take(s.mailbox) do
      {nil, _mailbox} ->
        s

      {envelope, mailbox} ->
        send(s.owner, {:topic, self(), envelope})
        %{s | mailbox: mailbox, asked: s.asked - 1}
    end
  end
end
