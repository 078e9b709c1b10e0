defmodule Swarm.Supervisor.BackoffSupervisorTest do
  use ExUnit.Case, async: true
  import Swarm.Case, only: [eventually: 1]
  alias Hal.Event
  alias Swarm.Supervisor.BackoffSupervisor
  @moduletag :realtime

  defp keep(options \\ []) do
    name = :"part#{System.unique_integer([:positive])}"
    agent = %{id: name, start: {Agent, :start_link, [fn -> options end, [name: name]]}}
    {name, start_supervised!({BackoffSupervisor, agent}, id: name)}
  end

  defp fall(name) do
    pid = eventually(fn -> Process.whereis(name) end)
    Process.exit(pid, :kill)
    eventually(fn -> Process.whereis(name) not in [nil, pid] end)
  end

  test "a part that crashes is started again, more often than a supervisor would" do
    {name, keeper} = keep()
    me = self()

    :ok =
      Event.attach(
        {__MODULE__, name},
        [:swarm, :part, :fell],
        fn _, _, about, _ -> send(me, about) end,
        nil
      )

    on_exit(fn -> Event.detach({__MODULE__, name}) end)
    for _ <- 1..8, do: assert(fall(name))
    assert Process.alive?(keeper)
    for _ <- 1..8, do: assert_receive(%{id: ^name, reason: :killed})
  end

  test "the part ends with its supervisor, and runs again with the next one" do
    {name, keeper} = keep()
    part = Process.whereis(name)
    Process.exit(keeper, :kill)
    assert eventually(fn -> Process.whereis(name) not in [nil, part] end)
    part = Process.whereis(name)
    :ok = stop_supervised(name)
    refute Process.alive?(part)
  end

  test "a part that cannot start is an error at once" do
    part = %{id: :part, start: {Agent, :start_link, [fn -> exit(:broken) end]}}
    assert {:error, {:broken, _}} = start_supervised({BackoffSupervisor, part})
  end
end
