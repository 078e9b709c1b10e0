defmodule Agents.Conversation do
  @moduledoc """
  Asks other programs and waits until a deadline, for one answer or for many.

      alias Agents.{Conversation, Envelope}
      question = Envelope.new(:query, :mag1, :battery)
      {:ok, answer} = Conversation.request({:min1, :power}, question, 500)
      {:partial, answers, [{:min2, :power}]} =
        Conversation.gather([{:min1, :power}, {:min2, :power}], question, 500)

  A peer is a process, or `{robot, service}`, which the directory knows (`Agents.Responder`).

  Nothing here waits for a node that is dead or silent: what cannot be sent at once is not sent,
  and that peer counts as missing. Each peer answers to an alias of its own that takes one
  message, so that a second answer, or one after the deadline, reaches no mailbox.
  """
  alias Agents.Envelope
  alias Swarm.Directory
  alias Swarm.Directory.RemoteMonitor
  alias Swarm.Wire

  # Most answers arrive long before this. Only then is it worth asking the runtime whether the
  # others are alive: between nodes that costs more than the question.
  @patience_ms 20

  @type peer :: pid() | {robot :: atom(), service :: atom()}
  @type reason :: :unknown | :not_connected | :busy | :gone | :no_answer
  @type quorum :: :all | :majority | non_neg_integer()

  @doc """
  Sends an envelope, if that can be done at once. Errors: `:unknown` (no such service in the directory),
  `:not_connected` (its node), `:busy` (the connection to it is full).
  """
  @spec tell(peer(), Envelope.t()) :: :ok | {:error, :unknown | :not_connected | :busy}
  def tell(peer, %Envelope{} = envelope) do
    case find(peer) do
      nil -> {:error, :unknown}
      pid -> post(pid, envelope)
    end
  end

  @doc """
  Sends an envelope to an address: a process, or the `reply_to` of an envelope (`nil`: none).
  """
  @spec post(Envelope.address() | nil, Envelope.t()) :: :ok | {:error, :not_connected | :busy}
  def post(nil, _envelope), do: :ok

  # Without these options, a send waits while the buffer is full, or dials a robot that is gone.
  def post(address, envelope) do
    case :erlang.send(address, envelope, [:nosuspend, :noconnect]) do
      :ok -> :ok
      :noconnect -> {:error, :not_connected}
      :nosuspend -> {:error, :busy}
    end
  end

  @doc """
  Asks one peer, and waits for its answer: an envelope of any kind, including `:refuse` and
  `:failure`. Errors, besides those of `tell/2`: `:gone` (it ended), `:no_answer` (within the
  time, in ms).
  """
  @spec request(peer(), Envelope.t(), timeout_ms :: non_neg_integer()) ::
          {:ok, Envelope.t()} | {:error, reason()}
  def request(peer, %Envelope{} = envelope, timeout_ms \\ 500) do
    patience!(timeout_ms)

    case ask([peer], envelope, timeout_ms, 1) do
      {%{^peer => answer}, _missing} -> {:ok, answer}
      {_none, [{^peer, reason}]} -> {:error, reason}
    end
  end

  @doc """
  Asks many peers at once, and returns their answers, and the missing peers. It ends when the quorum
  has answered, when all that are still there have answered, or at the deadline (ms from now).

  Missing peers are listed in the order of the peers. The quorum is `:all` (the default),
  `:majority` of the peers asked, or a number. `:complete` says that the quorum was reached.
  It does not wait for a peer that cannot be reached, or that leaves meanwhile.
  """
  @spec gather([peer()], Envelope.t(), deadline_ms :: non_neg_integer(), quorum()) ::
          {:complete | :partial, answers :: %{peer() => Envelope.t()}, missing :: [peer()]}
  def gather(peers, %Envelope{} = envelope, deadline_ms, quorum \\ :all) do
    patience!(deadline_ms)
    peers = peers!(peers)
    enough = enough(quorum, length(peers))
    {answers, missing} = ask(peers, envelope, deadline_ms, enough)
    state = if map_size(answers) >= enough, do: :complete, else: :partial
    {state, answers, in_order(peers, missing)}
  end

  # In the order in which they were asked, not in which they dropped out.
  defp in_order(_peers, []), do: []

  defp in_order(peers, missing) do
    missing = Map.new(missing)
    for peer <- peers, is_map_key(missing, peer), do: peer
  end

  defp enough(:all, count), do: count
  defp enough(:majority, count), do: div(count, 2) + 1
  defp enough(number, _count) when is_integer(number) and number >= 0, do: number

  defp enough(other, _count) do
    raise ArgumentError,
          "quorum: expected :all, :majority, or a whole number from 0, got #{brief(other)}"
  end

  @doc false
  # A mistake here is the calling program's own, and raises; the mistakes of others are returned.
  @spec patience!(term()) :: :ok
  def patience!(ms) do
    if Wire.ms?(ms),
      do: :ok,
      else: raise(ArgumentError, "timeout: expected whole ms, up to a day, got #{brief(ms)}")
  end

  @doc false
  @spec peers!(term()) :: [peer()]
  def peers!(peers) do
    if is_list(peers) and not List.improper?(peers),
      do: Enum.uniq(peers),
      else: raise(ArgumentError, "#{brief(peers)} is not a list of peers")
  end

  defp brief(term), do: inspect(term, limit: 5, printable_limit: 40)

  defp ask(peers, envelope, ms, enough) do
    now = Hal.Clock.now_ms()
    {pending, missing} = post_all(peers, envelope, %{}, [])
    deadline = now + ms
    patience = min(now + @patience_ms, deadline)
    {answers, pending, missing} = collect(%{}, pending, missing, enough, patience)

    if pending == %{} or map_size(answers) >= enough or patience == deadline do
      close(answers, pending, missing)
    else
      # Of an answer and this `:DOWN`, only the first gets through an alias.
      watch = RemoteMonitor.start(Map.new(pending, fn {ref, {_peer, pid}} -> {ref, pid} end))
      {answers, pending, missing} = collect(answers, pending, missing, enough, deadline)
      RemoteMonitor.stop(watch)
      close(answers, pending, missing)
    end
  end

  defp post_all([], _envelope, pending, missing), do: {pending, missing}

  defp post_all([peer | rest], envelope, pending, missing) do
    with pid when is_pid(pid) <- find(peer),
         ref = :erlang.alias([:reply]),
         {:sent, :ok, _ref} <- {:sent, post(pid, %{envelope | reply_to: ref}), ref} do
      post_all(rest, envelope, Map.put(pending, ref, {peer, pid}), missing)
    else
      nil ->
        post_all(rest, envelope, pending, [{peer, :unknown} | missing])

      {:sent, {:error, reason}, ref} ->
        :erlang.unalias(ref)
        post_all(rest, envelope, pending, [{peer, reason} | missing])
    end
  end

  defp collect(answers, pending, missing, enough, _deadline)
       when pending == %{} or map_size(answers) >= enough,
       do: {answers, pending, missing}

  defp collect(answers, pending, missing, enough, deadline) do
    receive do
      %Envelope{in_reply_to: ref} = envelope when is_map_key(pending, ref) ->
        {{peer, _pid}, pending} = Map.pop!(pending, ref)

        case Envelope.check(envelope) do
          {:ok, answer} ->
            answers |> Map.put(peer, answer) |> collect(pending, missing, enough, deadline)

          {:error, _reason} ->
            collect(answers, pending, [{peer, :no_answer} | missing], enough, deadline)
        end

      {RemoteMonitor, ref, :gone} when is_map_key(pending, ref) ->
        {{peer, _pid}, pending} = Map.pop!(pending, ref)
        collect(answers, pending, [{peer, :gone} | missing], enough, deadline)
    after
      max(deadline - Hal.Clock.now_ms(), 0) -> {answers, pending, missing}
    end
  end

  # From here on no answer reaches the mailbox; one that has already arrived counts.
  defp close(answers, pending, missing) do
    for {ref, {peer, _pid}} <- pending, reduce: {answers, missing} do
      {answers, missing} ->
        :erlang.unalias(ref)

        receive do
          %Envelope{in_reply_to: ^ref} = envelope ->
            case Envelope.check(envelope) do
              {:ok, answer} -> {Map.put(answers, peer, answer), missing}
              {:error, _reason} -> {answers, [{peer, :no_answer} | missing]}
            end

          {RemoteMonitor, ^ref, :gone} ->
            {answers, [{peer, :gone} | missing]}
        after
          0 -> {answers, [{peer, :no_answer} | missing]}
        end
    end
  end

  @doc "The process of a peer now, preferably one on this node; `nil` if there is none."
  @spec find(peer()) :: pid() | nil
  def find(pid) when is_pid(pid), do: pid

  def find({robot, service}) do
    case Directory.members({:service, service, robot}) do
      [] -> nil
      [first | _] = pids -> Enum.find(pids, first, &(node(&1) == node()))
    end
  end

  def find(_other), do: nil
end
