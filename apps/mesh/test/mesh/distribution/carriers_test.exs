defmodule Mesh.Distribution.CarriersTest do
  @moduledoc """
  Real nodes with the carriers, on the addresses of this machine's loopback; addresses that are not of this machine need
  a network of their own (`test/netns_strangers_test.exs`).
  """
  # Each node has a name and a port of its own.
  use ExUnit.Case, async: true
  alias Mesh.Distribution
  alias Mesh.Distribution.{Certs, ConnectionLog, Listener, Preload, Tcp_dist, Tls_dist}
  @moduletag :realtime
  @moduletag :tmp_dir

  unless System.find_executable("openssl"), do: @moduletag(skip: "openssl is missing")

  @at_once 20
  @strange {203, 0, 113, 7}

  # For each carrier: the ports of three nodes, the arguments of one that has it, and of one that has OTP's.
  defp carriers(tmp) do
    {:ok, :made} = Certs.ca(tmp)
    {:ok, :made} = Certs.robot(tmp, "both", false)
    papers = ["-ssl_dist_optfile", Path.expand(Path.join(tmp, "both/ssl_dist.conf"))]

    [
      {[9_771, 9_772, 9_773], ~w(-proto_dist Elixir.Mesh.Distribution.Tcp), []},
      {[9_774, 9_775, 9_776], ~w(-proto_dist Elixir.Mesh.Distribution.Tls) ++ papers,
       ~w(-proto_dist inet_tls) ++ papers}
    ]
  end

  test "nodes with a carrier of the mesh and with OTP's connect, both ways", %{tmp_dir: tmp} do
    for {ports, flags, otp} <- carriers(tmp) do
      [first, second, third] = Enum.zip_with(ports, [flags, flags, otp], &node/2)

      assert Vm.call(first, Node, :connect, [second.node])
      assert Vm.call(first, Node, :connect, [third.node])
      assert Vm.call(third, Node, :connect, [second.node])
      assert Enum.sort(Vm.call(second, Node, :list, [])) == Enum.sort([first.node, third.node])
      assert Vm.call(second, :erpc, :call, [first.node, :erlang, :node, []]) == first.node
      assert Vm.call(third, Distribution.Access, :there?, []) == false

      Vm.stop(third)
      assert Vm.call(second, Node, :disconnect, [first.node])
      assert Vm.call(second, Node, :connect, [first.node])
    end
  end

  test "a node with a carrier calls the addresses of its fleet only", %{tmp_dir: tmp} do
    for {[port | _], flags, _otp} <- carriers(tmp) do
      # Whoever tries to connect there waits for two minutes; the call here gives up after ten seconds.
      node = node(port, ~w(-kernel net_setuptime 120) ++ flags)
      strange = :"strange@203.0.113.7"
      assert Vm.call(node, :net_kernel, :connect_node, [strange]) == false
      refute Vm.call(node, Distribution.Access, :reachable?, [@strange, 0])
      now = Vm.call(node, System, :monotonic_time, [:millisecond])
      :ok = Vm.call(node, Distribution.Access, :heard, [[@strange], now])
      assert Vm.call(node, Distribution.Access, :reachable?, [@strange, now])
    end
  end

  test "whoever calls too often is refused before anything is read, and let in later", %{
    tmp_dir: tmp
  } do
    for {[port, other | _], flags, _otp} <- carriers(tmp) do
      [first, second] = for port <- [port, other], do: node(port, flags)

      # So many at a time that it takes less than the ten seconds after which none would have been too many.
      calls =
        for _ <- 1..(6 * @at_once), do: Task.async(fn -> say_hello(port, "nonode@nohost") end)

      Task.await_many(calls, 60_000)
      assert Vm.call(first, Mesh, :refused, []).too_often in 1..(5 * @at_once)

      assert Hal.Lines.eventually(fn -> Vm.call(second, Node, :connect, [first.node]) end)
    end
  end

  # Whoever is not root may not open the ports by which it is known.
  @tag skip: System.cmd("id", ["-u"]) != {"0\n", 0} && "it takes root"
  test "root's shell is let in at once, however often and by how many names others call", %{
    tmp_dir: tmp
  } do
    for {[port, other | _], flags, _otp} <- carriers(tmp) do
      first = node(port, flags)
      shell = node(other, flags ++ ~w(-mesh_shell true))
      flood = for n <- 1..2, do: Task.async(fn -> flood(port, n) end)
      assert Hal.Lines.eventually(fn -> Vm.call(first, Mesh, :refused, []).too_often > 100 end)

      for _ <- 1..5 do
        assert Vm.call(shell, Node, :connect, [first.node])
        # On a busy machine the other side has hung up first.
        Vm.call(shell, Node, :disconnect, [first.node])
      end

      Enum.each(flood, &Task.shutdown(&1, :brutal_kill))
    end
  end

  defp flood(port, n) do
    say_hello(port, "flood-#{n}@nowhere")
    flood(port, n + 2)
  end

  test "a node whose code is not found yet lets in and refuses as ever", %{tmp_dir: tmp} do
    for {[port, other | _], flags, _otp} <- carriers(tmp) do
      [first, second] = for port <- [port, other], do: node(port, flags)

      # As while Mix starts, which goes from folder to folder, and so away from a path that begins nowhere.
      paths = Vm.call(first, :code, :get_path, [])
      others = Enum.reject(paths, &("#{&1}" =~ ~r"/lib/(hal|mesh)/ebin$"))
      assert length(others) == length(paths) - 2
      true = Vm.call(first, :code, :set_path, [others])
      :ok = Vm.call(first, :erl_prim_loader, :set_path, [[]])

      assert Vm.call(second, Node, :connect, [first.node])
      calls = for _ <- 1..(3 * @at_once), do: Task.async(fn -> say_hello(port, "x@y") end)
      Task.await_many(calls, 60_000)
      assert %{too_often: refused} = Vm.call(first, Distribution.Access.Refusals, :counts, [])
      assert refused > 0
      assert Vm.call(first, :code, :is_loaded, [Hal.Event])
      assert Vm.call(second, Node, :disconnect, [first.node])
      assert Hal.Lines.eventually(fn -> Vm.call(second, Node, :connect, [first.node]) end)
    end
  end

  test "all that the distribution runs is loaded first" do
    entries = [Mesh.Distribution.Epmd, Tcp_dist, Tls_dist, ConnectionLog, ConnectionLog.Peer]
    # These run when they ask for the others.
    loaded = [Tcp_dist, Tls_dist, Mesh.Distribution.Epmd, Listener, Preload]
    assert Enum.sort(called(entries, []) -- loaded) == Enum.sort(Preload.modules())
  end

  # The modules of this project that are called from these, directly or not, and these.
  defp called([], seen), do: seen

  defp called([module | rest], seen) do
    if module in seen or not String.starts_with?("#{module}", ["Elixir.Mesh.", "Elixir.Hal."]) do
      called(rest, seen)
    else
      {:ok, {_module, imports: calls}} = :beam_lib.chunks(:code.which(module), [:imports])
      called(Enum.uniq(for({called, _, _} <- calls, do: called)) ++ rest, [module | seen])
    end
  end

  defp open(port),
    do: :gen_tcp.connect({127, 0, 0, 1}, port, [:binary, packet: 2, active: false])

  test "names that nobody knows make few atoms, also from this machine", %{tmp_dir: tmp} do
    [{[port | _], flags, _otp} | _tls] = carriers(tmp)
    node = node(port, flags)
    names = for n <- 1..1_000, do: "name#{n}@nowhere"
    for name <- names, do: say_hello(port, name)
    assert Enum.count(names, &atom?(node, &1)) in 10..(2 * @at_once)
    assert %{too_often: often, new_names: names} = Vm.call(node, Mesh, :refused, [])
    assert often + names >= 1_000 - 2 * @at_once
  end

  defp atom?(node, name) do
    is_atom(Vm.call(node, :erlang, :binary_to_existing_atom, [name]))
  rescue
    ArgumentError -> false
  end

  defp say_hello(port, name) do
    with {:ok, socket} <- open(port) do
      hello = <<?N, 0x0D07F7FBD::64, 1::32, byte_size(name)::16, name::binary>>
      answer = with :ok <- :gen_tcp.send(socket, hello), do: :gen_tcp.recv(socket, 0, 10_000)
      :gen_tcp.close(socket)
      answer
    end
  end

  defp node(port, flags) do
    name = "c#{port}"

    flags =
      ~w(-start_epmd false -epmd_module Elixir.Mesh.Distribution.Epmd) ++
        ~w(-kernel dist_auto_connect never -kernel logger_level none -kernel connect_all false) ++
        ~w(-kernel inet_dist_use_interface {127,0,0,1} -setcookie carriers) ++
        ["-name", "#{name}@here.convoy"] ++ flags

    peers = Enum.map_join(9_771..9_776, ",", &"c#{&1}@here.convoy=127.0.0.1:#{&1}")
    env = [{"CONVOY_DIST_PORT", "#{port}"}, {"ROBOT", name}, {"CONVOY_PEERS", peers}]
    Vm.start_one(flags: flags, env: env)
  end
end
