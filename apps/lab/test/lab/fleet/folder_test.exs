defmodule Lab.Fleet.FolderTest do
  # VMs of their own, which are killed.
  use ExUnit.Case, async: true
  import Swarm.Case, only: [eventually: 1]
  alias Lab.Fleet.Folder
  @moduletag :realtime

  # An agent of that VM makes it, as a fleet's process does.
  defp folder(vm) do
    :ok = Vm.start_apps(vm, [:elixir])
    {:ok, agent} = Vm.call(vm, Agent, :start, [Folder, :make, []])
    {:ok, folder} = Vm.call(vm, Agent, :get, [agent, Function, :identity, []])
    File.write!(Path.join(folder, ".erlang.cookie"), "a cookie")
    assert Bitwise.band(File.stat!(folder).mode, 0o777) == 0o700
    folder
  end

  # Whether this program, and so those that it starts, ignore the signal of that number.
  defp ignored?(number) do
    [_all, mask] = Regex.run(~r/^SigIgn:\t([0-9a-f]+)$/m, File.read!("/proc/self/status"))
    Bitwise.band(String.to_integer(mask, 16), Bitwise.bsl(1, number - 1)) != 0
  end

  test "the folder of a run is removed when the run is killed, ends or crashes" do
    [killed, ended, hung_up] = Vm.start(for _ <- 1..3, do: [])
    folders = for vm <- [killed, ended, hung_up], do: folder(vm)

    # Under nohup all programs ignore that their terminal has gone.
    hang_up = if ignored?(1), do: "TERM", else: "HUP"

    for {vm, signal} <- [{killed, "KILL"}, {ended, "TERM"}, {hung_up, hang_up}],
        do: Vm.signal(vm, signal)

    for folder <- folders, do: assert(eventually(fn -> not File.exists?(folder) end))
  end

  test "it is removed with the process that made it" do
    {:ok, agent} = Agent.start(Folder, :make, [])
    {:ok, folder} = Agent.get(agent, & &1)
    assert File.dir?(folder)
    Process.exit(agent, :kill)
    assert eventually(fn -> not File.exists?(folder) end)
  end
end
