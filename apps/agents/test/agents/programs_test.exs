defmodule Agents.ProgramsTest do
  use Swarm.Case, async: false
  alias Agents.{Conversation, Envelope, Programs}
  alias Agents.Answerers.Echo

  defmodule Broken do
    @behaviour Agents.Responder
    @impl Agents.Responder
    def init(_robot, _argument), do: raise("no such port")
    @impl Agents.Responder
    def handle(_envelope, s), do: {:noreply, s}
  end

  defmodule Hangs do
    @behaviour Agents.Responder
    @impl Agents.Responder
    def init(_robot, {:start, test}), do: hang(test)
    def init(_robot, test), do: test

    @impl Agents.Responder
    def handle(%{content: :hang}, test) do
      Process.flag(:trap_exit, true)
      hang(test)
    end

    defp hang(test) do
      send(test, {:hangs, self()})
      receive do: (:go_on -> {:noreply, test})
    end
  end

  defp host(robot, more \\ []) do
    catalogue = [echo: Echo, power: {Echo, 11.5}, broken: Broken] ++ more
    host = start_supervised!(Programs.child_spec({%{config(robot) | id: robot}, catalogue}))
    eventually(fn -> Directory.members({:service, :programs, robot}) != [] end)
    host
  end

  defp config(robot), do: Robot.Case.config(robot)

  defp ask(robot, content, service \\ :programs, performative \\ :request) do
    question = Envelope.new(performative, :desk, content)
    {:ok, answer} = Conversation.request({robot, service}, question, 5_000)
    {answer.performative, answer.content}
  end

  test "programs of the build start and end by name; what is refused is said in one line" do
    host(:prog1)
    listen(:prog1, [:swarm, :comms, :ordered])
    stopped = [{"echo", false}, {"power", false}, {"broken", false}]
    assert ask(:prog1, :programs, :programs, :query) == {:inform, stopped}

    assert ask(:prog1, {:start, "echo", "page 127.0.0.1:1"}) == {:inform, "echo"}

    assert_receive {[:swarm, :comms, :ordered],
                    %{order: "program start echo", by: "page 127" <> _}}

    eventually(fn -> Directory.members({:service, :echo, :prog1}) != [] end)
    assert ask(:prog1, 7, :echo) == {:inform, 7}
    assert {:inform, [{"echo", true} | _]} = ask(:prog1, :programs, :programs, :query)
    assert {:refuse, "echo runs on prog1 already"} = ask(:prog1, {:start, "echo", nil})
    # What is no name is none's service.
    :ok = :pg.join(Directory, {:service, 7, :prog1}, self())
    assert {:prog1, [:echo, :programs]} in Directory.services()

    assert {:inform, "echo"} = ask(:prog1, {:end, "echo", nil})
    assert_receive {[:swarm, :comms, :ordered], %{order: "program end echo", by: by}}
    assert by == "another program"
    assert Names.whereis(:prog1, {:service, :echo}) == nil
    assert {:refuse, "echo does not run on prog1"} = ask(:prog1, {:end, "echo", nil})

    assert {:refuse, line} = ask(:prog1, {:start, "ecco", nil})
    assert line == ~s(prog1 has no program "ecco"; it has echo, power, broken; did you mean echo?)
    assert {:refuse, line} = ask(:prog1, {:start, "broken", nil})
    assert line =~ "broken does not start on prog1" and line =~ "no such port"

    for junk <- [{:start, :echo, nil}, {:begin, "echo", nil}, {:start, "echo"}, :programs],
        do: assert({:refuse, "expected a program to start or to end"} = ask(:prog1, junk))
  end

  test "one that crashes takes nothing along, and all end with their robot" do
    host(:prog2)
    {:inform, "echo"} = ask(:prog2, {:start, "echo", nil})
    {:inform, "power"} = ask(:prog2, {:start, "power", nil})
    echo = Names.whereis(:prog2, {:service, :echo})
    power = Process.monitor(Names.whereis(:prog2, {:service, :power}))
    ref = Process.monitor(echo)
    Process.exit(echo, :kill)
    assert_receive {:DOWN, ^ref, :process, ^echo, :killed}
    eventually(fn -> Names.whereis(:prog2, {:service, :echo}) == nil end)

    assert {:inform, [{"echo", false}, {"power", true}, _]} =
             ask(:prog2, :programs, :programs, :query)

    assert {:inform, "echo"} = ask(:prog2, {:start, "echo", nil})
    :ok = stop_supervised(Programs)
    assert_receive {:DOWN, ^power, :process, _pid, :shutdown}
  end

  test "one that hangs is ended, and does not hold up the end of its robot" do
    for {robot, argument, name} <- [{:prog5, {:start, self()}, "slow"}, {:prog6, self(), "deaf"}] do
      host(robot, slow: {Hangs, argument}, deaf: {Hangs, argument})
      request = Envelope.new(:request, :desk, {:start, name, nil})
      :ok = Conversation.tell({robot, :programs}, request)

      if name == "deaf" do
        eventually(fn -> Directory.members({:service, :deaf, robot}) != [] end)
        :ok = Conversation.tell({robot, :deaf}, Envelope.new(:request, :desk, :hang))
      end

      assert_receive {:hangs, program}
      if name == "deaf", do: assert({:inform, "deaf"} = ask(robot, {:end, "deaf", nil}))
      {us, :ok} = :timer.tc(fn -> stop_supervised(Programs) end)
      assert us < 3_000_000
      send(program, :go_on)
    end
  end

  test "one that is a part of the robot is not ended here" do
    host(:prog3)
    own = [service: :echo, module: Echo]
    start_supervised!({Agents.Responder, {:prog3, own}})
    assert {:refuse, "echo is part of prog3, and ends with it"} = ask(:prog3, {:end, "echo", nil})
  end

  test "each robot has those of the configuration; the battery tells volts that are of now" do
    robot(:prog4)
    eventually(fn -> Directory.members({:service, :programs, :prog4}) != [] end)
    assert {:inform, "battery"} = ask(:prog4, {:start, "battery", "terminal"})
    eventually(fn -> Directory.members({:service, :battery, :prog4}) != [] end)
    assert ask(:prog4, :volts, :battery, :query) == {:inform, nil}
    send(Names.whereis(:prog4, :drive), {:readings, [{:power, 12.5}]})
    eventually(fn -> ask(:prog4, :volts, :battery, :query) == {:inform, 12.5} end)
    assert ask(:prog4, :amperes, :battery, :query) == {:refuse, :unknown}

    # It falls with its robot.
    ref = Process.monitor(Names.whereis(:prog4, {:service, :battery}))
    :ok = stop_supervised(:prog4)
    assert_receive {:DOWN, ^ref, :process, _pid, :shutdown}
  end
end
