defmodule Robot.LockstepTest do
  use ExUnit.Case, async: true
  alias Robot.Lockstep

  # A role that keeps what it was told, and tells others what it is asked to.
  for name <- [:gate, :executive, :pilot] do
    defmodule Module.concat(__MODULE__, name) do
      @behaviour Robot.Role
      defstruct log: [], boot: nil, told: nil
      @impl true
      def name, do: unquote(name)
      @impl true
      def period_ms, do: nil
      @impl true
      def priority, do: :normal
      @impl true
      def init(config, board, _at_ms) do
        told = with {told, _at_ms} <- board[:pose], do: told
        {%__MODULE__{boot: config.boot, told: told}, [{:cast, :gate, {:begun, unquote(name)}}]}
      end

      @impl true
      def handle({:cast, {:tell, effects}}, _at_ms, s, _board), do: {s, effects}
      def handle({:cast, :unknown}, _at_ms, _s, _board), do: :unknown
      def handle({:cast, what}, at_ms, s, _board), do: {%{s | log: [{what, at_ms} | s.log]}, []}
      def handle({:tick, n}, at_ms, s, _b), do: {%{s | log: [{n, at_ms} | s.log]}, [{:look, 0.5}]}
    end
  end

  defp robot(seed \\ nil) do
    options = [id: :mag1, profile: Hal.Profile.magellan(), drive: {Some.Drive, []}, boot: 1]
    Lockstep.new(struct!(Robot.Config, options), modules(), %{}, seed)
  end

  defp modules, do: for(name <- [:gate, :executive, :pilot], do: Module.concat(__MODULE__, name))

  defp log(robot, role), do: robot.roles[role].log |> Enum.map(&elem(&1, 0)) |> Enum.reverse()

  # The executive and the pilot tell the gate two things each.
  defp talk(robot) do
    told = fn who -> {:tell, for(n <- 1..2, do: {:cast, :gate, {who, n}})} end

    both = {:cast, {:tell, [{:cast, :executive, told.(:e)}, {:cast, :pilot, told.(:p)}]}}

    {robot, []} = Lockstep.input(robot, :gate, both, 10)
    robot
  end

  test "roles hear each other in the order in which they tell it" do
    assert log(talk(robot()), :gate) == [e: 1, e: 2, p: 1, p: 2]
  end

  test "or in an order that is drawn, the same for a seed, and never two of one role the other way round" do
    orders = for n <- 1..60, do: log(talk(robot({n, 1, 0})), :gate)
    assert orders == for(n <- 1..60, do: log(talk(robot({n, 1, 0})), :gate))
    assert length(Enum.uniq(orders)) == 6

    for order <- orders, who <- [:e, :p], do: assert(Keyword.get_values(order, who) == [1, 2])
  end

  test "what is noticed outside is returned, and what is for none here, or not known, is lost" do
    effects = [
      {:drive, Hal.Twist.zero(), [:estop]},
      {:cast, :comms, :stop},
      {:put, :pose, :here},
      {:put, :asking, :soon},
      {:delete, :asking},
      {:latch, true},
      {:event, [:a], %{}},
      {:apply, {:cast, :pilot, :applied}},
      {:apply, {Kernel, :send, [self(), :applied]}},
      {:answer, nil, :ok},
      {:send, :all, %{}},
      {:transmit, :all, %{}},
      {:stage, :there, %{}}
    ]

    {robot, out} = Lockstep.input(robot(), :executive, {:cast, {:tell, effects}}, 20)
    assert out == [{:drive, Hal.Twist.zero()}, {:send, :all, %{}}, {:stage, :there, %{}}]
    assert log(robot, :pilot) == [:applied]
    refute_received :applied

    assert %{pose: {:here, 20}, latch: {true, 20}, driving: {%{limits: [:estop]}, 20}} =
             robot.board

    refute is_map_key(robot.board, :asking)
    assert Lockstep.input(robot, :pilot, {:cast, :unknown}, 30) == {robot, []}
    assert Lockstep.input(robot, :comms, {:cast, :stop}, 30) == {robot, []}
  end

  test "a role that crashes begins anew with those behind it, in another life, from the board" do
    {robot, []} =
      Lockstep.input(talk(robot()), :executive, {:cast, {:tell, [{:put, :pose, :here}]}}, 20)

    {robot, []} = Lockstep.crash(robot, :executive, 30)
    assert %{executive: %{boot: 2, told: :here, log: []}, pilot: %{boot: 2}} = robot.roles

    # The gate goes on, and hears what the others do at their start.
    assert log(robot, :gate) == [e: 1, e: 2, p: 1, p: 2, begun: :executive, begun: :pilot]
  end

  test "what a role that hangs is told waits; after two seconds it is killed" do
    {robot, []} = Lockstep.hang(robot(), :pilot, 500, 0)

    inputs = [{:cast, :a}, {:tick, 1}, {:cast, :b}, {:tick, 2}]
    robot = Enum.reduce(inputs, robot, &elem(Lockstep.input(&2, :pilot, &1, 100), 0))
    assert {^robot, []} = Lockstep.wake(robot, 400)
    assert {woken, [{:look, 0.5, _tilt}]} = Lockstep.wake(robot, 500)
    # Its ticker asks for a tick when the last one was handled.
    assert woken.roles.pilot.log == [{2, 500}, {:b, 500}, {:a, 500}]

    {robot, []} = Lockstep.hang(robot(), :pilot, 5_000, 0)
    {robot, []} = Lockstep.input(robot, :pilot, {:cast, :a}, 100)
    {robot, []} = Lockstep.wake(robot, 1_900)
    assert robot.roles.pilot.boot == 1
    {robot, []} = Lockstep.wake(robot, 2_000)
    assert %{boot: 2, log: []} = robot.roles.pilot
  end
end
