defmodule Agents.ContractNet do
  @moduledoc """
  Auctions of tasks: the lowest bidder gets the task (Smith 1980; FIPA's contract net).

      defmodule Carry do
        @behaviour Agents.ContractNet
        @impl Agents.ContractNet
        def cost({:carry, metres}, _robot, speed),
          do: Agents.ContractNet.Cost.of(path: metres, speed: speed)

        def cost(_other, _robot, _speed), do: :infinite

        @impl Agents.ContractNet
        def work({:carry, _metres}, robot, _speed, report) do
          report.(:on_my_way)
          {:carried_by, robot}
        end
      end

      # on each robot
      tasks = [service: :tasks, module: Agents.ContractNet.Bidding, argument: {Carry, 0.3}]
      companions: [{Agents.Responder, tasks}]

      # anywhere
      peers = for robot <- [:mag1, :mag2], do: {robot, :tasks}
      {:ok, {:mag1, :tasks}, {:carried_by, :mag1}} =
        Agents.ContractNet.auction({:carry, 3.0}, peers, from: :base)

  The rules are in `Agents.ContractNet.Manager` and `Agents.ContractNet.Bidder`.
  """
  alias Agents.ContractNet.{Cost, Manager}
  alias Agents.{Conversation, Envelope}
  alias Swarm.Directory.RemoteMonitor
  alias Swarm.Wire

  @doc """
  What a task would cost this robot; `:infinite` if it cannot do it, or does not know it. It must
  be quick, because the robot answers no request meanwhile.
  """
  @callback cost(task :: term(), robot :: atom(), argument :: term()) :: Cost.t()

  @doc """
  Does a task, and returns its result. `report.(note)` says that there is progress: a robot that says
  nothing for 5 s loses the task.
  """
  @callback work(
              task :: term(),
              robot :: atom(),
              argument :: term(),
              report :: (note :: term() -> :ok)
            ) :: result :: term()

  @doc """
  Announces a task to peers (`t:Agents.Conversation.peer/0`), awards it, and waits in the calling
  process until it is done; use a `Task` to do something else meanwhile. If the caller ends, the
  work goes on, and the result is dropped.

  Options: `:from` (the asking robot; required), and those of `Agents.ContractNet.Manager`. Errors:
  `:nobody` (no peer is there, or left), `:no_bids` (none can or will), `:busy` (those that can were
  doing something else for `:wait_ms`, 5 s unless given), `:given_up` (every try failed).
  """
  @spec auction(task :: term(), [Conversation.peer()], keyword()) :: Manager.outcome()
  def auction(task, peers, options) do
    # Check everything before anything is started that would have to be ended.
    {letter, options} = begin(options)
    pids = for peer <- Conversation.peers!(peers), pid = Conversation.find(peer), do: {peer, pid}

    # One alias per peer: what arrives by it is from that peer, whatever name it gives.
    found = for {peer, pid} <- pids, into: %{}, do: {peer, {pid, :erlang.alias()}}
    refs = for {peer, {_pid, ref}} <- found, into: %{}, do: {ref, peer}
    watch = RemoteMonitor.start(for {_peer, {pid, ref}} <- found, into: %{}, do: {ref, pid})

    outcome =
      task
      |> Manager.start(Map.keys(found), options, Hal.Clock.now_ms(), letter.conversation)
      |> send_all(found, letter)
      |> run(found, refs, letter)

    RemoteMonitor.stop(watch)
    Enum.each(refs, fn {ref, _peer} -> close(ref) end)
    outcome
  end

  defp begin(options) do
    unless Keyword.keyword?(options) and Wire.name?(options[:from]) do
      raise ArgumentError, "an auction needs from: the name of who asks, an atom such as :mag1"
    end

    {from, options} = Keyword.pop!(options, :from)
    # All rounds are in the same conversation.
    {Envelope.new(:cfp, from, nil), Manager.options!(options)}
  end

  defp run(%{outcome: nil} = manager, found, refs, letter) do
    step =
      receive do
        %Envelope{in_reply_to: ref} = envelope when is_map_key(refs, ref) ->
          case Envelope.check(envelope) do
            {:ok, e} ->
              Manager.hear(manager, refs[ref], e.performative, e.content, Hal.Clock.now_ms())

            {:error, _field} ->
              {manager, []}
          end

        {RemoteMonitor, ref, :gone} when is_map_key(refs, ref) ->
          Manager.gone(manager, refs[ref], Hal.Clock.now_ms())
      after
        max(manager.due_ms - Hal.Clock.now_ms(), 0) -> Manager.tick(manager, Hal.Clock.now_ms())
      end

    step |> send_all(found, letter) |> run(found, refs, letter)
  end

  defp run(%{outcome: outcome}, _found, _refs, _letter), do: outcome

  defp send_all({manager, []}, _found, _letter), do: manager

  defp send_all({manager, [{peer, performative, content} | rest]}, found, letter) do
    {pid, ref} = Map.fetch!(found, peer)
    letter = %{letter | performative: performative, content: content, reply_to: ref}

    case Conversation.post(pid, letter) do
      # The letters that follow from it are sent after those that were decided before.
      {:error, :not_connected} ->
        {manager, letters} = Manager.gone(manager, peer, Hal.Clock.now_ms())
        send_all({manager, rest ++ letters}, found, letter)

      _sent_or_busy ->
        send_all({manager, rest}, found, letter)
    end
  end

  # From here on nothing arrives by it, and what has arrived is removed.
  defp close(ref) do
    :erlang.unalias(ref)
    flush(ref)
  end

  defp flush(ref) do
    receive do
      %Envelope{in_reply_to: ^ref} -> flush(ref)
      {RemoteMonitor, ^ref, :gone} -> flush(ref)
    after
      0 -> :ok
    end
  end
end
