defmodule Swarm.Commands.Client do
  @moduledoc false
  # Asks robots, wherever they are, and gathers what they answer. What stops a robot goes to its
  # e-stop process, all else to its comms. A command for another node bears a stamp (`Swarm.Commands.Freshness`); who has
  # none at hand asks the robot for one first.
  alias Robot.{Board, Names}
  alias Mesh.Nonblocking
  alias Swarm.{Directory, EStop}
  alias Swarm.Commands.Freshness

  @answer_ms 500
  # Half of what is too old for the robot: the other half is for the way there.
  @fresh_ms 1_000

  @doc """
  What the robots answer within half a second; who does not is not in the map. All are asked at once,
  so that a silent robot holds up nobody else's answer.
  """
  @spec ask([atom()], term()) :: %{atom() => term()}
  def ask(robots, request) do
    deadline = System.monotonic_time(:millisecond) + @answer_ms

    waiting =
      for id <- robots,
          to = whereabouts(id, request),
          asked = first(id, to, request),
          into: %{},
          do: asked

    gather(waiting, request, %{}, deadline)
  end

  defp gather(waiting, _request, answers, _deadline) when map_size(waiting) == 0, do: answers

  defp gather(waiting, request, answers, deadline) do
    receive do
      {ref, answer} when is_map_key(waiting, ref) ->
        case Map.pop!(waiting, ref) do
          {{:stamp, id, to}, waiting} ->
            waiting =
              case post(id, to, request, answer) do
                {ref, about} -> Map.put(waiting, ref, about)
                nil -> waiting
              end

            gather(waiting, request, answers, deadline)

          {{:command, id}, waiting} ->
            gather(waiting, request, Map.put(answers, id, answer), deadline)
        end
    after
      max(deadline - System.monotonic_time(:millisecond), 0) -> give_up(waiting, answers)
    end
  end

  # An answer may have come just before its alias was gone.
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

  # The nearest process that takes the request. Where its node is not connected, or not heard, the way by
  # others comes first, `{:relay, process or nil}`; `nil` where nobody knows the robot.
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

  defp first(id, to, request) do
    cond do
      not Freshness.needed?(request) ->
        post(id, to, request, nil)

      is_pid(to) and node(to) == node() ->
        post(id, to, request, {:asked, System.monotonic_time(:microsecond)})

      # An e-stop process knows its own stamps only.
      stamp = request != :reset && stamp(id) ->
        post(id, to, request, stamp)

      true ->
        post(id, to, :stamp)
    end
  end

  defp post(id, to, :stamp), do: cast(id, to, {:stamp}, {:stamp, id, to})
  defp post(id, to, request, nil), do: cast(id, to, {:command, request}, {:command, id})

  defp post(id, to, request, stamp),
    do: cast(id, to, {:command, request, stamp}, {:command, id})

  # By an alias: an answer that comes too late finds no mailbox. `nil` where no way leads there.
  defp cast(id, to, order, about) do
    ref = :erlang.alias([:reply])
    order = with_ref(order, ref)

    case hand(to, id, order, ref) do
      :ok ->
        {ref, about}

      {:error, _no_way} ->
        :erlang.unalias(ref)
        nil
    end
  end

  # Where there is no way round, the silent connection may yet be one.
  defp hand({:relay, pid}, id, order, ref) do
    with {:error, _no_way} = error <- Mesh.relay(id, order, ref),
         do: if(pid, do: Nonblocking.cast(pid, order), else: error)
  end

  defp hand(pid, _id, order, _ref), do: Nonblocking.cast(pid, order)

  defp with_ref({:stamp}, ref), do: {:stamp, ref}
  defp with_ref({:command, request}, ref), do: {:command, request, ref}
  defp with_ref({:command, request, stamp}, ref), do: {:command, request, ref, stamp}

  # The newest heartbeat of a robot that this node has heard, by its radio or by one of its robots.
  defp stamp(id) do
    case Mesh.beat(id) do
      {boot, sequence, age_ms} when age_ms < @fresh_ms -> {boot, sequence}
      _old_or_none -> Enum.find_value(Names.robots(), &heard(&1, id))
    end
  end

  defp heard(here, id) do
    with {:ok, board} <- Board.find(here),
         {:ok, %{beat: beat}, _at_ms} <- Board.fetch(board, {:peer, id}, @fresh_ms) do
      {beat.boot, beat.sequence}
    else
      :error -> nil
    end
  end
end
