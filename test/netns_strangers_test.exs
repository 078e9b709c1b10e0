Code.require_file("netns/load.exs", __DIR__)
modules = :persistent_term.get(:netns_modules)
why_not = Vm.Net.why_not()

defmodule System.NetnsStrangersTest do
  @moduledoc """
  Two whole robots and a stranger, each in a network namespace of its own. The stranger calls the distribution of a
  robot, each time by another name; the other robot is the one that calls it, by the order of their names. With `FIGURES=1` each test prints what it has measured.
  """
  use ExUnit.Case, async: false
  @moduletag :realtime
  import Swarm.Case, only: [eventually: 1]
  alias Hal.Pose
  alias Mesh.Distribution.{Certs, Epmd}
  alias Netns.{Caller, Fleet}
  alias Vm.Net

  @moduletag timeout: 600_000
  @moduletag skip: why_not

  @poses [mag1: Pose.new(-1.7, 0.0, 0.0), mag2: Pose.new(-1.7, 1.0, 0.0)]
  @modules modules
  @at_once 24
  # What a robot's own life makes meanwhile, such as modules that are loaded and names in its log.
  @own_atoms 500
  @own_bytes 4_000_000

  setup context do
    folder =
      Path.join(System.tmp_dir!(), "convoy-netns-#{System.pid()}-#{:rand.uniform(1_000_000)}")

    File.mkdir_p!(folder)
    options = if context[:tls], do: [carrier: tls(folder)], else: []
    options = [guests: [:stranger]] ++ options
    {:ok, fleet} = Fleet.start_link({@poses, folder, @modules, options})
    net = Fleet.net(fleet)
    on_exit(fn -> Net.delete(net) end)
    stranger = Vm.start_one(through: ["ip", "netns", "exec", Net.space(net, :stranger)])
    Fleet.ship(stranger, @modules)
    assert eventually(fn -> connected?(fleet) end)
    %{fleet: fleet, stranger: stranger}
  end

  # The certificates of the fleet, and the arguments that a robot's Erlang gets.
  defp tls(folder) do
    certs = Path.join(folder, "certs")
    {:ok, :made} = Certs.ca(certs)
    for {robot, _pose} <- @poses, do: {:ok, :made} = Certs.robot(certs, "#{robot}", false)

    fn robot ->
      ["-proto_dist", "Elixir.Mesh.Distribution.Tls"] ++
        ["-ssl_dist_optfile", Path.join([certs, "#{robot}", "ssl_dist.conf"])]
    end
  end

  @calm_ms 3_000
  # Ten times as many as the atoms that a robot's own life may make meanwhile.
  @some 5_000

  test "thousands of calls of a stranger leave nothing behind, and disturb nobody", context do
    knock(context, @some)
  end

  @tag :tls
  @tag long: true, realtime: :long
  test "with TLS a stranger is refused before the handshake of TLS, and fellows are not",
       context do
    knock(context, @some)
  end

  @tag long: true, realtime: :long
  @tag :tls
  test "with TLS 20,000 calls of a stranger leave nothing behind, and disturb nobody", context do
    knock(context, 20_000)
  end

  @tag long: true, realtime: :long
  test "a million calls of a stranger leave nothing behind, and disturb nobody", context do
    knock(context, 1_000_000)
  end

  defp knock(%{fleet: fleet, stranger: stranger}, times) do
    target = Net.address(Fleet.net(fleet), :mag2)
    port = Epmd.default_port("mag2")
    assert Vm.call(stranger, Caller, :call, [target, port]) == :refused

    calm = ticks_per_second(fleet, @calm_ms)
    before = state(fleet)
    arguments = [target, port, times, @at_once]
    calls = Task.async(fn -> Vm.call(stranger, Caller, :call, arguments, 500_000) end)

    {refused, met} = meet_until(fleet, calls, [])
    afterwards = state(fleet)
    took = afterwards.at_ms - before.at_ms
    ticks = (afterwards.tick - before.tick) * 1_000 / took

    if System.get_env("FIGURES") do
      IO.puts(
        "#{times} calls: #{refused} refused in #{took} ms, #{afterwards.atoms - before.atoms} atoms, " <>
          "#{afterwards.bytes - before.bytes} bytes, #{afterwards.resident - before.resident} kB resident, " <>
          "#{Float.round(ticks, 2)} ticks a second (before: #{Float.round(calm, 2)}), " <>
          "the fellow was back #{length(met)} times, after #{Enum.max(met)} ms at most"
      )
    end

    assert refused == times
    assert afterwards.atoms - before.atoms < @own_atoms
    assert afterwards.bytes - before.bytes < @own_bytes
    assert afterwards.ports <= before.ports + 2

    # Ten a second are all that there should be. Other tests may have taken the processors meanwhile: that is no
    # stranger's doing. One tick more, because the first and the last are counted between two ticks.
    calm = Enum.min([10.0, calm, ticks_per_second(fleet, @calm_ms)])
    assert ticks + 1_000 / took > 0.95 * calm
    assert Enum.max(met) < 10_000
    assert %{stranger: counted} = Fleet.call(fleet, :mag2, Mesh, :refused, [])
    assert counted >= times
    assert connected?(fleet)
  end

  test "from a fellow's address calls are let in at a bounded rate, and few new names", context do
    %{fleet: fleet} = context
    net = Fleet.net(fleet)
    program = Vm.start_one(through: ["ip", "netns", "exec", Net.space(net, :mag1)])
    Fleet.ship(program, @modules)
    before = state(fleet)
    began = now()
    arguments = [Net.address(net, :mag2), Epmd.default_port("mag2"), 2_000, @at_once]
    refused = Vm.call(program, Caller, :call, arguments, 60_000)
    seconds = div(now() - began, 1_000) + 1
    # One call of those that the robots make by themselves.
    assert (2_000 - refused) in 18..21
    assert %{too_often: often, new_names: names} = Fleet.call(fleet, :mag2, Mesh, :refused, [])
    assert often + names == refused
    assert names <= 10 * seconds
    assert state(fleet).atoms - before.atoms < @own_atoms
    assert eventually(fn -> connected?(fleet) end)
  end

  # Meanwhile the two are parted again and again; how long each time it took to meet, in ms.
  defp meet_until(fleet, calls, met) do
    began = now()
    true = Fleet.call(fleet, :mag1, Node, :disconnect, [:mag2@convoy])
    assert eventually(fn -> connected?(fleet) end)
    met = [now() - began | met]

    case Task.yield(calls, 500) do
      {:ok, refused} -> {refused, met}
      nil -> meet_until(fleet, calls, met)
    end
  end

  defp connected?(fleet) do
    Fleet.call(fleet, :mag1, Node, :list, []) == [:mag2@convoy] and
      Fleet.call(fleet, :mag2, Node, :list, []) == [:mag1@convoy]
  end

  defp ticks_per_second(fleet, ms) do
    before = state(fleet)
    Process.send_after(self(), :over, ms)
    assert_receive :over, 10 * ms
    afterwards = state(fleet)
    (afterwards.tick - before.tick) * 1_000 / (afterwards.at_ms - before.at_ms)
  end

  defp state(fleet) do
    board = Fleet.call(fleet, :mag2, Robot.Board, :find!, [:mag2])
    {:ok, doing, _ms} = Fleet.call(fleet, :mag2, Robot.Board, :fetch, [board, :doing, :infinity])
    # The time of the tick, not of the end of what follows, which takes a busy machine longer.
    at_ms = now()

    for pid <- Fleet.call(fleet, :mag2, Process, :list, []),
        do: Fleet.call(fleet, :mag2, :erlang, :garbage_collect, [pid])

    %{
      tick: doing.tick,
      at_ms: at_ms,
      atoms: Fleet.call(fleet, :mag2, :erlang, :system_info, [:atom_count]),
      bytes: Fleet.call(fleet, :mag2, :erlang, :memory, [:total]),
      ports: length(Fleet.call(fleet, :mag2, Port, :list, [])),
      resident: div(Vm.resident(Fleet.node(fleet, :mag2)), 1024)
    }
  end

  defp now, do: System.monotonic_time(:millisecond)
end
