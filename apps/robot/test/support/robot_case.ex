defmodule Robot.Case do
  @moduledoc """
  A robot with fake drivers (see `Hal.Fake`), which tell the test process what they are asked to
  do. Robots of all tests live in one registry, so each test uses ids of its own.
  """
  use ExUnit.CaseTemplate
  alias Hal.Twist
  alias Robot.Names

  using do
    quote do
      import Robot.Case
      alias Hal.Twist
      alias Robot.{Acts, Board, Names}
      alias Robot.Control.{Executive, Pilot}
      alias Robot.Safety.Gate
    end
  end

  setup do
    # That of this app's own suite runs all the time.
    if Process.whereis(Names) == nil, do: start_supervised!(Names)
    :ok
  end

  @doc "A config with fake drivers; `options` replace."
  def config(id, options \\ []) do
    [
      id: id,
      profile: Hal.Profile.magellan(),
      drive: {Hal.FakeDrive, test: self(), device: :drive}
    ]
    |> Keyword.merge(options)
    |> Robot.Config.new!()
  end

  @doc "A running robot, whose base has reported if it is the usual fake; it ends with the test."
  def robot(id, options \\ []) do
    start_supervised!({Robot.Supervisor, config(id, options)}, id: id, restart: :temporary)
    if options[:drive] == nil, do: online(id)
    id
  end

  @doc "Waits until the base of a robot has reported, and has been armed if it arms by itself."
  def online(id) do
    health(id, :online)
    # In the step in which it writes that it is online it then writes whether it is armed.
    _state = id |> Robot.Names.whereis(:drive) |> :sys.get_state(30_000)
    id
  end

  @doc "Waits until the drive of a robot is in this health."
  def health(id, wanted, left \\ 2_000) do
    case Robot.Board.fetch(Robot.Board.find!(id), {:health, :drive}, :infinity) do
      {:ok, ^wanted, _at_ms} -> id
      other when left == 0 -> flunk("the drive of #{id}: #{inspect(other)}")
      _not_yet -> receive(do: (:never -> :ok), after: (5 -> health(id, wanted, left - 1)))
    end
  end

  @doc "A robot whose mission lets it roll."
  def rolling(id, options \\ []) do
    goal = {:goal, :roll, {Robot.Acts.Roll, twist: Twist.new(0.1, 0.0)}}
    mission = {Robot.Acts.Mission, effects: [goal]}
    robot(id, Keyword.put_new(options, :mission, mission))
    :ok = Robot.Control.Pilot.start(id)
    id
  end

  @doc "Sends `{event, metadata}` to the test at each such event of this robot."
  def listen(id, event) do
    handler = {__MODULE__, id, event}
    :ok = Hal.Event.attach(handler, event, &__MODULE__.forward/4, {id, self()})
    on_exit(fn -> Hal.Event.detach(handler) end)
  end

  @doc false
  def forward(event, _measurements, %{robot: id} = metadata, {id, test}),
    do: send(test, {event, metadata})

  def forward(_event, _measurements, _another_robots, _config), do: :ok

  @doc "The processes of the robot in these roles."
  def parts(id, roles), do: Enum.map(roles, &Names.whereis(id, &1))

  @doc "Ends a part as nothing can stop it, and waits until it is gone."
  def kill(id, role) do
    pid = Names.whereis(id, role)
    monitor = Process.monitor(pid)
    Process.exit(pid, :kill)
    assert_receive {:DOWN, ^monitor, _, _, :killed}
    pid
  end

  @doc "Makes a file of which every write hangs, as on a disk that does not answer, until `resume/1`."
  def hang(file) do
    {_nothing, 0} = System.cmd("mkfifo", [file])
    # No thread of this VM may hang there for ever.
    ends = ["if=#{file}", "iflag=nonblock", "of=/dev/null"]
    on_exit(fn -> System.cmd("dd", ends, stderr_to_stdout: true) end)
  end

  @doc "Lets the write go on that hangs there."
  def resume(file) do
    {_written, 0} = System.cmd("timeout", ["20", "cat", file])
    :ok
  end

  @doc "Looks again until it is true, and returns what it is. For what no event tells."
  def eventually(look, left \\ 2_000) do
    found = look.()

    cond do
      found -> found
      left == 0 -> flunk("it did not come to pass")
      true -> receive(do: (:never -> nil), after: (5 -> eventually(look, left - 1)))
    end
  end

  @doc "Waits until the wheels roll."
  def rolls do
    assert_receive {:drive, {:drive, %Twist{linear: v}}, _} when v > 0
    forget_drives()
  end

  @doc "Checks that the wheels are told nothing but to stand, from now on for so long."
  def stands(ms) do
    forget_drives()

    receive do
      {:drive, {:drive, %Twist{linear: v}}, _} when v != 0 -> flunk("rolls at #{v} m/s")
    after
      ms -> :ok
    end
  end

  @doc "Forgets all speeds that the drive was told so far."
  def forget_drives do
    receive do
      {:drive, {:drive, _twist}, _pid} -> forget_drives()
    after
      0 -> :ok
    end
  end
end
