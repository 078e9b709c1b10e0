defmodule Agents.ContractNet.Bidding do
  @moduledoc """
  Serves a robot that bids for tasks and carries them out: an `Agents.Responder` whose argument is `{module, argument}`,
  the module a `Agents.ContractNet`. The work runs in a process of its own, so that the robot keeps answering;
  cancelling a task ends it.
  """
  alias Agents.ContractNet.Bidder
  alias Agents.{Conversation, Envelope}

  @behaviour Agents.Responder

  @impl Agents.Responder
  def init(robot, {module, argument}) when is_atom(module) do
    # The end of the work arrives as a message; the end of this process ends the work.
    Process.flag(:trap_exit, true)
    %{robot: robot, module: module, argument: argument, bidder: %Bidder{}, work: nil}
  end

  @impl Agents.Responder
  def handle(%{performative: :cfp, content: {round, task, left_ms}} = envelope, s)
      when is_integer(round) and is_integer(left_ms) do
    cost = s.module.cost(task, s.robot, s.argument)
    key = key(envelope, round)

    {bidder, {performative, content}} =
      Bidder.announced(s.bidder, key, task, cost, left_ms, Hal.Clock.now_ms())

    {{performative, {round, content}}, %{s | bidder: bidder}}
  end

  def handle(%{performative: :accept, content: round} = envelope, s) do
    {bidder, answer} = Bidder.accepted(s.bidder, key(envelope, round), Hal.Clock.now_ms())
    s = %{s | bidder: bidder}

    case answer do
      {:start, task} -> {{:agree, round}, %{s | work: start(task, envelope, s)}}
      :working -> {{:agree, round}, s}
      :refuse -> {{:refuse, {round, :not_bound}}, s}
    end
  end

  def handle(%{performative: :reject, content: round} = envelope, s),
    do: {:noreply, %{s | bidder: Bidder.rejected(s.bidder, key(envelope, round))}}

  def handle(%{performative: :cancel, content: round} = envelope, s) do
    case Bidder.cancelled(s.bidder, key(envelope, round)) do
      {bidder, :stop} ->
        {pid, _accept} = s.work
        Process.exit(pid, :kill)
        {:noreply, %{s | bidder: bidder, work: nil}}

      {bidder, :nothing} ->
        {:noreply, %{s | bidder: bidder}}
    end
  end

  def handle(envelope, s), do: {{:refuse, {envelope.performative, :not_understood}}, s}

  @impl Agents.Responder
  def info({:EXIT, pid, reason}, %{work: {pid, accept}} = s) do
    case reason do
      {:shutdown, {:done, result}} -> tell(s.robot, accept, :inform, {:done, result})
      _failed -> tell(s.robot, accept, :failure, :failed)
    end

    %{s | bidder: Bidder.finished(s.bidder), work: nil}
  end

  def info(_other, s), do: s

  defp start(task, accept, %{robot: robot, module: module, argument: argument}) do
    pid =
      spawn_link(fn ->
        report = fn note -> tell(robot, accept, :inform, {:progress, note}) end
        exit({:shutdown, {:done, module.work(task, robot, argument, report)}})
      end)

    {pid, accept}
  end

  defp tell(robot, %{content: round} = accept, performative, content) do
    content = if is_tuple(content), do: Tuple.insert_at(content, 0, round), else: {round, content}
    Conversation.post(accept.reply_to, Envelope.reply(accept, performative, robot, content))
    :ok
  end

  defp key(envelope, round), do: {envelope.conversation, round}
end
