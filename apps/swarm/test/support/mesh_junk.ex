defmodule Swarm.MeshNodes.Junk do
  @moduledoc """
  Senseless terms, and the processes of a node that other nodes can send them to. Run on that
  node:

      [] = Swarm.MeshNodes.call(node, Swarm.MeshNodes.Junk, :pour, [node.name])
  """

  @names [
    Mesh.CommandRelay,
    Mesh.Dialer,
    Mesh.Server,
    Swarm.EStop.Broadcaster,
    Swarm.Discovery.Presence,
    Swarm.Blackboard
  ]

  @tags ~w(speak serve introduce knock note hear put enter leave repair there back repeat pass_on quiet
           estop command in_time stamp present rejected rival say beat follow subscribe unsubscribe
           udp udp_passive udp_error nodeup nodedown DOWN EXIT forget again info status)a

  @doc """
  Sends all terms to each process in every way, waits until they have handled them, and returns
  the processes that crashed.
  """
  @spec pour(robot :: atom()) :: [atom() | {atom(), atom()}]
  def pour(robot) do
    found = for name <- @names ++ [{robot, :comms}, {robot, :estop}], do: {name, pid(name)}
    terms = terms()
    for {_name, pid} <- found, term <- terms, do: send_all(pid, term)
    for {name, pid} <- found, not looked?(pid) or pid(name) != pid, do: name
  end

  defp pid({robot, role}), do: Robot.Names.whereis(robot, role)
  defp pid(name), do: Process.whereis(name)

  defp send_all(pid, term) do
    send(pid, term)
    send(pid, {:"$gen_cast", term})
    # Nobody waits for an answer.
    send(pid, {:"$gen_call", {self(), make_ref()}, term})
  end

  defp looked?(pid) do
    _state = :sys.get_state(pid, 20_000)
    true
  catch
    :exit, _fell -> false
  end

  @doc "Terms of all types, alone and inside all messages between these processes."
  @spec terms() :: [term()]
  def terms do
    plain() ++
      for(tag <- @tags, a <- plain(), do: {tag, a}) ++
      for(tag <- @tags, a <- few(), b <- few(), do: {tag, a, b}) ++
      for(tag <- @tags, a <- few(), b <- few(), do: {tag, a, b, a}) ++
      for(tag <- @tags, a <- few(), b <- few(), do: {tag, b, a, b, a}) ++
      for(tag <- @tags, a <- few(), b <- few(), do: {tag, a, b, b, a, b})
  end

  defp plain do
    [
      nil,
      :junk,
      -1,
      1.0e308,
      Bitwise.bsl(1, 80_000),
      <<255, 0>>,
      <<1::3>>,
      :binary.copy("x", 100_000),
      [1 | 2],
      [{:a, 1}],
      {},
      %{__struct__: Swarm.Message},
      %{__struct__: Swarm.Member, from: 1},
      %{__struct__: :nothing},
      make_ref(),
      self(),
      fn -> raise "called" end,
      Enum.reduce(1..10_000, [], fn _n, term -> [term] end),
      Enum.to_list(1..10_000)
    ]
  end

  defp few, do: [:junk, -1, "text", [1 | 2], [], make_ref(), self(), {:a, 1}, [node()]]
end
