defmodule Mesh.Distribution.ConnectionLogTest do
  @moduledoc "Real nodes with certificates: one listens, others knock."
  use ExUnit.Case, async: false
  alias Mesh.Distribution.{Certs, ConnectionLog}
  @moduletag :realtime

  @moduletag :tmp_dir
  unless System.find_executable("openssl"), do: @moduletag(skip: "openssl is missing")

  test "whoever has the wrong papers is refused, and named in one line", %{tmp_dir: tmp} do
    [ours, other] = for folder <- ~w(ours other), do: Path.join(tmp, folder)
    for folder <- [ours, other], do: {:ok, :made} = Certs.ca(folder)
    for name <- ~w(door guest), do: {:ok, :made} = Certs.robot(ours, name, false)
    {:ok, :made} = Certs.robot(other, "spy", false)
    none = Path.join(ours, "none.conf")

    text = File.read!(Path.join(ours, "guest/ssl_dist.conf"))
    lines = Enum.reject(String.split(text, "\n"), &(&1 =~ ~r/\{(certfile|keyfile)/))
    File.write!(none, Enum.join(lines, "\n"))

    door = node("door", 9761, conf(ours, "door"), "right", "Elixir.Mesh.Distribution.Tls")
    log = Path.join(tmp, "log")
    :ok = Vm.call(door, ConnectionLog, :install, [])
    handler = %{config: %{file: String.to_charlist(log)}}
    :ok = Vm.call(door, :logger, :add_handler, [:file, :logger_std_h, handler])

    guest = node("guest", 9762, conf(ours, "guest"))
    assert Vm.call(guest, Node, :connect, [:door@tls])
    assert Vm.call(door, Node, :list, []) == [:guest@tls]
    Vm.stop(guest)

    for {name, papers, cookie, line} <- [
          {"spy", conf(other, "spy"), "right", "refused us: our certificate is of another fleet"},
          {"bare", none, "right", "refused a node at 127.0.0.1:N: it has no certificate"},
          {"plain", nil, "right", "refused a node at 127.0.0.1:N: it does not speak TLS"},
          {"guest", conf(ours, "guest"), "wrong",
           "refused guest@tls at 127.0.0.1:N: wrong cookie"}
        ] do
      vm = node(name, 9762, papers, cookie)
      refute Vm.call(vm, Node, :connect, [:door@tls])
      Vm.stop(vm)
      logged(log, line)
    end

    # Who does not check us itself is refused by us, by the name in its certificate.
    knock = ["s_client", "-tls1_2", "-connect", "127.0.0.1:9761", "-cert"]
    papers = [Path.join(other, "spy/cert.pem"), "-key", Path.join(other, "spy/key.pem")]

    # Its input stays open, so that it ends only when it has heard the refusal.
    openssl = {:spawn_executable, System.find_executable("openssl")}
    client = Port.open(openssl, [:binary, :stderr_to_stdout, args: knock ++ papers])
    logged(log, "refused spy at 127.0.0.1:N: its certificate is of another fleet (unknown CA)")
    if Port.info(client), do: Port.close(client)
    assert Vm.call(door, Node, :list, []) == []
    refute File.read!(log) =~ "ALERT"
  end

  test "a crowd that knocks does not fill the log" do
    state = :atomics.new(2, [])

    message =
      {~c"** Connection attempt from node ~w rejected. Invalid challenge reply. **~n", [:a@b]}

    event = %{level: :error, msg: message, meta: %{time: 0}}
    answers = for _ <- 1..1_000, do: ConnectionLog.filter(event, state)
    said = Enum.filter(answers, &is_map/1)
    # The thousand may fall into two seconds.
    assert length(said) in 5..10

    assert %{level: :warning, msg: {:string, "refused a@b at an unknown address: wrong" <> _}} =
             hd(said)

    assert ConnectionLog.filter(%{event | msg: {:string, "hello"}}, state) == :ignore
  end

  defp conf(folder, name), do: Path.expand(Path.join([folder, name, "ssl_dist.conf"]))

  defp node(name, port, papers, cookie \\ "right", carrier \\ "inet_tls") do
    tls = if papers, do: ["-proto_dist", carrier, "-ssl_dist_optfile", papers], else: []

    flags =
      ~w(-start_epmd false -epmd_module Elixir.Mesh.Distribution.Epmd -kernel dist_auto_connect never) ++
        ["-kernel", "logger_level", "notice", "-setcookie", cookie, "-sname", "#{name}@tls"] ++
        tls

    env = [
      {"CONVOY_DIST_PORT", "#{port}"},
      {"ROBOT", name},
      {"CONVOY_PEERS", "door@tls=127.0.0.1:9761"}
    ]

    vm = Vm.start_one(flags: flags, env: env)
    # What it says is read from a file.
    :ok = Vm.call(vm, :logger, :remove_handler, [:default])
    vm
  end

  defp logged(log, line) do
    Hal.Lines.eventually(fn -> said(log) =~ line end)
  rescue
    error in ExUnit.AssertionError ->
      flunk("#{error.message}: #{line}\nThe log says:\n#{said(log)}")
  end

  defp said(log) do
    case File.read(log) do
      {:ok, text} -> String.replace(text, ~r/127.0.0.1:\d+/, "127.0.0.1:N")
      {:error, :enoent} -> ""
    end
  end
end
