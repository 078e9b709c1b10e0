defmodule Swarm.Commands.Client do
  @moduledoc """
  Sends requests to robots, wherever they are, and gathers their answers. Commands that stop a
  robot go to its e-stop process, all others to its comms process. Before an order to another
  node, the robot is asked for a stamp (`Swarm.Order.Freshness`).
  """
  alias Mesh.Nonblocking
  alias Swarm.{Directory, EStop, Replacement}
  alias Swarm.Order.{Freshness, Giver}

  @answer_ms 500
  # In the dictionary of the process: the order may be given by any function of `Swarm`, also within code of others.
  @given {__MODULE__, :given_us}
  @by {__MODULE__, :by}

  @doc "Calls a function whose orders count as given then (`Swarm.given/2`)."
  @spec given(at_us :: integer(), (... -> result)) :: result when result: term()
  def given(at_us, fun), do: within(@given, min(at_us, given_us()), fun)

  @doc "Calls a function whose orders are given by this giver then (`Swarm.by/2`)."
  @spec by(giver :: String.t(), (... -> result) | {module(), atom(), [term()]}) ::
          result | term()
        when result: term()
  def by(giver, {module, function, arguments}),
    do: by(giver, fn -> apply(module, function, arguments) end)

  def by(giver, fun) when is_function(fun, 0), do: within(@by, Giver.text(giver), fun)

  defp within(key, value, fun) do
    before = Process.put(key, value)

    try do
      fun.()
    after
      if before, do: Process.put(key, before), else: Process.delete(key)
    end
  end

  @doc "When an order that this process gives now counts as given: now, but for `given/2`."
  @spec given_us() :: integer()
  def given_us, do: Process.get(@given) || now_us()

  @doc "The giver of the orders of this process (`Swarm.by/2`); `nil` where that was not said."
  @spec giver() :: String.t() | nil
  def giver, do: Process.get(@by)

  @doc "Whether an order of this process would be on time; the error is one line."
  @spec timely() :: :ok | {:error, line :: String.t()}
  def timely do
    waited_us = now_us() - given_us()
    if waited_us < @answer_ms * 1_000, do: :ok, else: Freshness.late(div(waited_us, 1_000))
  end

  @doc """
  The answers of the robots within half a second; a robot that does not answer is not in the map.
  All are asked at once, so that a silent robot does not delay another's answer. An order that was given longer ago is not
  sent.
  """
  @spec ask([atom()], term()) :: %{atom() => term()}
  def ask(robots, request) do
    needed? = Freshness.needed?(request)

    with true <- needed?, {:error, _line} = late <- timely() do
      Map.new(robots, &{&1, late})
    else
      _on_time -> ask(robots, request, if(needed?, do: given_us(), else: now_us()))
    end
  end

  defp ask(robots, request, given_us) do
    deadline = div(given_us, 1_000) + @answer_ms

    waiting =
      for id <- robots,
          to = whereabouts(id, request),
          asked = first(id, to, request, given_us),
          into: %{},
          do: asked

    gather(waiting, {request, given_us}, %{}, deadline)
  end

  defp gather(waiting, _request, answers, _deadline) when map_size(waiting) == 0, do: answers

  defp gather(waiting, request, answers, deadline) do
    receive do
      {ref, answer} when is_map_key(waiting, ref) ->
        case Map.pop!(waiting, ref) do
          {{:stamp, id, to}, waiting} ->
            waiting =
              case stamped(id, to, request, answer) do
                {ref, about} -> Map.put(waiting, ref, about)
                nil -> waiting
              end

            gather(waiting, request, answers, deadline)

          {{:command, id}, waiting} ->
            gather(waiting, request, Map.put(answers, id, answer), deadline)
        end
    after
      max(deadline - Hal.Clock.now_ms(), 0) -> give_up(waiting, answers)
    end
  end

  # An answer may have arrived just before its alias was removed.
  defp give_up(waiting, answers) do
    for {ref, about} <- waiting, reduce: answers do
      answers ->
        :erlang.unalias(ref)

        receive do
          {^ref, answer} -> late(about, answer, answers)
        after
          0 -> answers
        end
    end
  end

  defp late({:command, id}, answer, answers), do: Map.put(answers, id, answer)
  defp late({:stamp, _id, _to}, _stamp, answers), do: answers

  @doc """
  Of robots with such answers, those that do not accept, each with a line that says why.

      iex> Swarm.Commands.Client.refusals([:mag1, :mag2, :mag3], %{mag1: :ok, mag2: {:error, "mag2: its gate hangs"}})
      [mag2: "mag2: its gate hangs", mag3: "mag3 does not answer"]
  """
  @spec refusals([atom()], %{atom() => term()}) :: [{robot :: atom(), line :: String.t()}]
  def refusals(robots, answers) do
    accepted? = &(&1 == :ok or match?({:ok, _line}, &1))
    for id <- robots, not accepted?.(answers[id]), do: {id, refusal(id, answers[id])}
  end

  defp refusal(id, nil), do: "#{id} does not answer"
  defp refusal(_id, {:error, line}) when is_binary(line), do: line

  defp refusal(id, {:error, :no_formation}),
    do: "#{id} is not on a mission that has a formation; start it first"

  defp refusal(id, {:error, reason}), do: "#{id} refuses: #{inspect(reason)}"

  # The nearest process that takes the request. If its node is not connected, or not heard, the
  # way through other nodes comes first, `{:relay, process or nil}`; `nil` if no node knows the
  # robot.
  defp whereabouts(id, request) do
    pid = if(EStop.takes?(request), do: nearest({:estop, id})) || Directory.whereis(id)

    cond do
      pid && not Mesh.silent?(node(pid)) -> pid
      pid || Mesh.heard?(id) || id in Mesh.beyond() -> {:relay, pid}
      true -> nil
    end
  end

  defp nearest(group) do
    case Directory.members(group) do
      [] -> nil
      [first | _] = pids -> Enum.find(pids, first, &(node(&1) == node()))
    end
  end

  defp first(id, to, request, given_us) do
    cond do
      not Freshness.needed?(request) -> post(id, to, request, nil)
      is_pid(to) and node(to) == node() -> post(id, to, request, {:asked, given_us})
      true -> post(id, to, :stamp)
    end
  end

  defp stamped(id, to, {request, given_us}, stamp) do
    waited_us = now_us() - given_us

    with {:ok, order} <- Freshness.given(stamp, waited_us),
         do: post(id, to, request, order),
         else: (:error -> nil)
  end

  defp post(id, to, :stamp), do: cast(id, to, {:stamp}, {:stamp, id})
  defp post(id, to, request, nil), do: cast(id, to, {:command, request}, {:command, id})

  # Signed for this robot and this time.
  defp post(id, to, {:replace, content}, order) do
    with {:replace, _content, _mac} = request <- Replacement.seal(content, id, order),
         do: post(id, to, request, order)
  end

  defp post(id, to, request, order),
    do: cast(id, to, {:command, request, order}, {:command, id})

  # By an alias, so that a late answer reaches no mailbox. `nil` if there is no way to the robot.
  defp cast(id, to, order, about) do
    ref = :erlang.alias([:reply])
    order = with_ref(order, ref)

    case hand(to, id, order, ref) do
      {:ok, way} ->
        {ref, about(about, way)}

      {:error, _no_way} ->
        :erlang.unalias(ref)
        nil
    end
  end

  # An order goes the way of its stamp, because only the process that made the stamp knows it.
  defp about({:stamp, id}, way), do: {:stamp, id, way}
  defp about(about, _way), do: about

  # If there is no other way, the silent connection may still work.
  defp hand({:relay, pid}, id, order, ref) do
    case Mesh.relay(id, relayed(order), ref) do
      :ok -> {:ok, {:relay, nil}}
      {:error, _no_way} when pid != nil -> hand(pid, id, order, ref)
      error -> error
    end
  end

  defp hand(pid, _id, order, _ref), do: with(:ok <- Nonblocking.cast(pid, order), do: {:ok, pid})

  # The reference that arrives is one of the robot's own node. A stop says no giver, so that robots of an older release
  # take it, too.
  defp relayed({:command, stop, ref, {:by, _giver}}), do: {:command, stop, ref}

  defp relayed({:command, request, ref, order}),
    do: {:command, request, ref, order, Giver.node_text(node()) || "another node"}

  defp relayed(order), do: order

  defp now_us, do: System.monotonic_time(:microsecond)

  defp with_ref({:stamp}, ref), do: {:stamp, ref}

  defp with_ref({:command, request}, ref) do
    giver = Process.get(@by)

    if giver != nil and EStop.takes?(request),
      do: {:command, request, ref, {:by, giver}},
      else: {:command, request, ref}
  end

  defp with_ref({:command, request, order}, ref) do
    case Process.get(@by) do
      nil -> {:command, request, ref, order}
      giver -> {:command, request, ref, order, giver}
    end
  end
end
