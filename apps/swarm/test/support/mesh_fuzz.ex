defmodule Swarm.MeshNodes.Fuzz do
  @moduledoc """
  Random messages for the doors of a node: the roles of its robot, and the processes to which other nodes send. Each
  comes as a message, a cast and a call: a term that nobody knows, or, for those that check what they know, a known
  name around wrong values. The same seed gives the same messages. Run on that node:

      [] = Swarm.MeshNodes.call(node, Swarm.MeshNodes.Fuzz, :pour, [node.name, seed, 1_000])
  """

  @names [
    Mesh.CommandRelay,
    Mesh.Server,
    Swarm.Blackboard,
    Swarm.EStop.Broadcaster,
    Swarm.Replacement.Server
  ]

  # Hear only processes of their own robot, whose words they believe.
  @believing [:gate, :executive, :pilot]
  @unknown ~w(knock introduce serve listen repair there next subscribe leave)a
  @known @unknown ++
           ~w(speak hear put enter hint note back repeat pass_on quiet again estop command in_time stamp present rejected
              rival say beat release unlatched latch unsaved take keep stood started runs forget info counts sign
              unanswered result push status tick udp udp_passive udp_error)a

  # The longest mailbox that a gate or an e-stop process, which go before all others, may have.
  @short 500

  @doc "The doors of this node."
  @spec doors(robot :: atom()) :: [{term(), pid() | nil}]
  def doors(robot) do
    roles =
      for role <- @believing ++ [:estop, :comms], do: {role, Robot.Names.whereis(robot, role)}

    roles ++ for name <- @names, do: {name, Process.whereis(name)}
  end

  @doc """
  Sends each door `count` messages, and waits until all have handled them. Returns what is wrong with each that did not
  stand it: `{name, :ended}`, `{name, {:waiting, messages}}`, or for the gate and the e-stop process
  `{name, {:long, messages}}` meanwhile.
  """
  @spec pour(robot :: atom(), seed :: integer(), count :: pos_integer()) :: [tuple()]
  def pour(robot, seed, count) do
    doors = doors(robot)

    {long, _rand} =
      Enum.flat_map_reduce(doors, :rand.seed_s(:exsss, seed), fn {name, pid}, rand ->
        tags = if name in @believing, do: @unknown, else: @known
        {lengths, rand} = Enum.map_reduce(1..count, rand, &send_one(pid, tags, &1, &2))
        longest = Enum.max(lengths)
        long? = name in [:gate, :estop] and longest > @short
        {if(long?, do: [{name, {:long, longest}}], else: []), rand}
      end)

    :ok = Robot.Safety.Gate.estop(robot)
    long ++ for {name, pid} <- doors, problem = problem(pid), do: {name, problem}
  end

  # The length of its mailbox is asked now and then.
  defp send_one(pid, tags, n, rand) do
    {term, rand} = term(tags, rand)

    {message, rand} =
      pick(
        [
          term,
          {make_ref(), term},
          {:"$gen_cast", term},
          {:"$gen_call", {self(), make_ref()}, term}
        ],
        rand
      )

    send(pid, message)

    case rem(n, 50) == 0 && Process.info(pid, :message_queue_len) do
      {:message_queue_len, length} -> {length, rand}
      _not_now_or_ended -> {0, rand}
    end
  end

  defp problem(pid, tries \\ 2_000) do
    case Process.info(pid, :message_queue_len) do
      nil -> :ended
      {:message_queue_len, n} when n < 5 -> nil
      {:message_queue_len, n} when tries == 0 -> {:waiting, n}
      _some -> receive(do: (:never -> nil), after: (5 -> problem(pid, tries - 1)))
    end
  end

  # A request with up to four arguments, or no request at all.
  defp term(tags, rand) do
    {tag, rand} = pick(tags, rand)
    {size, rand} = :rand.uniform_s(6, rand)

    {values, rand} =
      Enum.map_reduce(1..max(size - 2, 1)//1, rand, fn _n, r -> pick(values(), r) end)

    case size do
      1 -> {hd(values), rand}
      2 -> {tag, rand}
      _more -> {List.to_tuple([tag | values]), rand}
    end
  end

  defp values do
    [
      nil,
      true,
      :junk,
      0,
      -1,
      1.0e308,
      Bitwise.bsl(1, 8_000),
      <<255, 0>>,
      <<1::3>>,
      large(),
      [],
      [1 | 2],
      [1, :odd, nil],
      [{:a, 1}],
      {},
      {:a, 1},
      %{},
      %{__struct__: Swarm.Message},
      %{__struct__: :nothing},
      make_ref(),
      {:delivered, :start, make_ref()},
      self(),
      node(),
      fn -> raise "called" end
    ]
  end

  defp large do
    with :undefined <- :persistent_term.get(__MODULE__, :undefined) do
      large = :binary.copy("x", 1_000_000)
      :persistent_term.put(__MODULE__, large)
      large
    end
  end

  defp pick(list, rand) do
    {n, rand} = :rand.uniform_s(length(list), rand)
    {Enum.at(list, n - 1), rand}
  end
end
