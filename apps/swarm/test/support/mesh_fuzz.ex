defmodule Swarm.MeshNodes.Fuzz do
  @moduledoc """
  Random messages for every process of this node's application, those of a robot with all parts
  among them: terms that nobody knows, and all shapes that OTP gives a message, around odd callers
  and requests. The same seed gives the same messages. Run on that node:

      [] = Swarm.MeshNodes.call(node, Swarm.MeshNodes.Fuzz, :pour, [node.name, seed, 1_000])
  """
  alias Hal.Pose
  alias Robot.Names

  @tags ~w(wish forget sense estop reset drive order disarm arm acknowledge arming look zoom frame aim
           camera next subscribe unsubscribe snapshot looks too_late no_frames picture obey confirm
           hold stand halt start stop resume command message outcome deliver goal open watchdog
           listen speak serve introduce knock note hear put enter leave repair push there back
           repeat pass_on quiet again in_time stamp present rejected rival say beat follow latch
           release register unregister join_local leave_local monitor demonitor sync discover join
           start_child terminate_child restart_child delete_child get_childspec which_children
           try_again_restart status info counts get_state get_status debug change_code hint
           unanswered settled forget tick step look udp udp_passive udp_error nodeup nodedown)a

  @doc "A robot of this node that is on a mission and has all devices, under its fleet."
  @spec robot(atom(), folder :: Path.t()) :: :ok
  def robot(id, folder) do
    {:ok, wheels} = Agent.start(fn -> nil end)
    fake = [test: wheels]

    config =
      Robot.Config.new!(
        id: id,
        profile: Hal.Profile.magellan(),
        drive: {Hal.FakeDrive, [device: :drive] ++ fake},
        ptz: {Hal.FakePtz, [device: :ptz] ++ fake},
        camera: {Hal.FakeCamera, [device: :camera] ++ fake},
        colours: colours(),
        save_pictures: [folder: folder]
      )

    {:ok, _robot} = Robot.Fleet.start_robot(Robot.Fleet, Swarm.Comms.join(config))
    Swarm.Case.stand(id, Pose.new(0, 0))
    # Its drive has still to take what its wheels report.
    start = fn -> Robot.Control.Pilot.start(id, Swarm.StandMission, []) == :ok end
    true = Swarm.Case.eventually(start)
    :ok
  end

  defp colours do
    {:ok, colours} =
      Vision.Colours.new([%{name: "Yellow", y: {170, 240}, u: {60, 90}, v: {130, 145}}])

    colours
  end

  # The longest mailbox that a gate or an e-stop process, which go before all others, may have.
  @short 500

  @doc """
  Sends each process `count` messages, and waits until all have handled them. Returns what is
  wrong with each process that did not stand it: `{name, :ended}`, `{name, {:waiting, messages}}`,
  or for the gate and the e-stop process `{name, {:long, messages}}` meanwhile.
  """
  @spec pour(robot :: atom(), seed :: integer(), count :: pos_integer()) :: [tuple()]
  def pour(robot, seed, count) do
    processes = processes()

    {long, _rand} =
      Enum.flat_map_reduce(processes, :rand.seed_s(:exsss, seed), fn {name, pid}, rand ->
        {lengths, rand} = Enum.map_reduce(1..count, rand, &send_one(pid, &1, &2))
        longest = Enum.max(lengths)
        first? = name in [{robot, :gate}, {robot, :estop}]
        {if(first? and longest > @short, do: [{name, {:long, longest}}], else: []), rand}
      end)

    :ok = Robot.Safety.Gate.estop(robot)
    long ++ for {name, pid} <- processes, problem = problem(pid), do: {name, problem}
  end

  # The length of its mailbox is asked now and then.
  defp send_one(pid, n, rand) do
    {message, rand} = message(rand)
    send(pid, message)

    case rem(n, 50) == 0 && Process.info(pid, :message_queue_len) do
      {:message_queue_len, length} -> {length, rand}
      _not_now_or_ended -> {0, rand}
    end
  end

  @doc "All processes of the application `:swarm`, and all others of this project with a name."
  @spec processes() :: [{term(), pid()}]
  def processes do
    named = for name <- Process.registered(), ours?(name), do: {name, Process.whereis(name)}
    roles = Names.all()
    known = MapSet.new(named ++ roles, &elem(&1, 1))

    others =
      for pid <- Process.list(),
          :application.get_application(pid) == {:ok, :swarm},
          pid not in known,
          {:dictionary, dictionary} <- [Process.info(pid, :dictionary)],
          # The other one is OTP's own, like those of its applications.
          start = dictionary[:"$initial_call"],
          not match?({:application_master, :init, _arity}, start),
          do: {{start, List.keyfind(dictionary, {Hal.HardenedServer.Drops, :who}, 0)}, pid}

    Enum.sort(named ++ roles ++ others)
  end

  defp ours?(name) do
    name = Atom.to_string(name)
    Enum.any?(~w(Hal Mesh Robot Swarm Vision), &String.starts_with?(name, "Elixir.#{&1}"))
  end

  defp problem(pid, tries \\ 2_000) do
    case Process.info(pid, :message_queue_len) do
      nil -> :ended
      {:message_queue_len, n} when n < 5 -> nil
      {:message_queue_len, n} when tries == 0 -> {:waiting, n}
      _some -> receive(do: (:never -> nil), after: (5 -> problem(pid, tries - 1)))
    end
  end

  defp message(rand) do
    {a, rand} = term(rand)
    {b, rand} = term(rand)
    {from, rand} = pick(callers(), rand)
    {ref, rand} = pick([make_ref(), :odd, 1, [:alias | make_ref()]], rand)
    {pid, rand} = pick([self(), spawn(fn -> :ok end), :odd, {:name, node()}], rand)

    pick(
      [
        a,
        :timeout,
        ref,
        {ref, a},
        {:"$gen_cast", a},
        {:"$gen_call", from, a},
        {:"$gen_event", a},
        {:"$gen_all_state_event", a},
        {:"$gen_sync_all_state_event", from, a},
        {:"$gen_restart", pid},
        {:notify, a},
        {:system, from, a},
        {:system, from, b},
        {:EXIT, pid, a},
        {:DOWN, ref, :process, pid, a},
        {{:DOWN, a}, ref, :process, pid, b},
        {:timeout, ref, a},
        {pid, {:data, a}},
        {pid, {:exit_status, a}},
        {:io_reply, ref, a},
        {a, b}
      ],
      rand
    )
  end

  defp callers do
    [
      :odd,
      nil,
      self(),
      {self(), make_ref()},
      {self(), [:alias | make_ref()]},
      {self(), [:alias | :odd]},
      {self(), [1 | 2]},
      {:odd, make_ref()},
      {spawn(fn -> :ok end), make_ref()},
      {self(), 1, 2},
      [self() | 1]
    ]
  end

  # A request with up to four arguments, or no request at all.
  defp term(rand) do
    {tag, rand} = pick(@tags, rand)
    {size, rand} = :rand.uniform_s(7, rand)

    {values, rand} =
      Enum.map_reduce(1..max(size - 2, 1)//1, rand, fn _n, rand -> pick(values(), rand) end)

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
      [self()],
      {},
      {:a, 1},
      {:sonar, [1 | 2]},
      {:sonar, [:odd]},
      {:bumpers, :odd},
      {:bumpers, [1 | 2]},
      {:odometry, %{pose: 1}},
      {:odometry, %Hal.Odometry{pose: 1, twist: 2}},
      {:arming, :odd},
      {:goal, :tag, {:nothing, 1}},
      {:anchors, 1},
      {:command, :odd},
      {:look, :odd},
      %{},
      %{linear: :odd, turn: nil},
      %{pan: 1, tilt: 2},
      %Hal.Twist{linear: 1.0e300, turn: :odd},
      %{__struct__: Hal.Twist},
      %{__struct__: Hal.Frame, bytes: 1},
      %{__struct__: Robot.Control.Delivery},
      %{__struct__: Swarm.Message},
      %{__struct__: :nothing},
      make_ref(),
      self(),
      node(),
      fn -> raise "called" end,
      {Nothing, :odd}
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
