defmodule Nodes.Case do
  @moduledoc """
  `bin/demo --nodes` as a program, whose processes are known by their numbers. A port mapper of its own keeps it apart
  from other fleets on the machine.
  """
  use ExUnit.CaseTemplate

  @root Path.expand("../..", __DIR__)

  using do
    quote do
      import Nodes.Case
      @moduletag timeout: 120_000
    end
  end

  setup do
    port = free_port()
    environment = [{"ERL_EPMD_PORT", "#{port}"}, {"ERL_EPMD_ADDRESS", "127.0.0.1"}]
    on_exit(fn -> System.cmd("epmd", ["-kill"], env: environment, stderr_to_stdout: true) end)
    %{environment: environment}
  end

  # None of those that the system hands out by itself, to another test perhaps.
  defp free_port do
    port = 20_000 + :rand.uniform(10_000)

    case :gen_tcp.listen(port, ip: {127, 0, 0, 1}) do
      {:ok, socket} ->
        :gen_tcp.close(socket)
        port

      {:error, :eaddrinuse} ->
        free_port()
    end
  end

  @doc "Starts a run with these options; it ends with the test. One that is not headless takes commands."
  def start(line, environment, view \\ "--headless") do
    arguments = OptionParser.split("#{view} --nodes --blobs direct --json - " <> line)
    environment = for {name, value} <- environment, do: {to_charlist(name), to_charlist(value)}
    options = [:binary, :exit_status, :stderr_to_stdout, args: arguments, env: environment]
    port = Port.open({:spawn_executable, Path.join(@root, "bin/demo")}, options)
    {:os_pid, pid} = Port.info(port, :os_pid)
    on_exit(fn -> System.cmd("kill", ["#{pid}"], stderr_to_stdout: true) end)
    port
  end

  @doc "Waits until the run has printed this; all that it has printed."
  def await(port, pattern, said \\ "") do
    if said =~ pattern do
      said
    else
      assert_receive {^port, {:data, more}}, 60_000, "nothing more after: " <> said
      await(port, pattern, said <> more)
    end
  end

  @doc "Waits until the run ends; all that it has printed, and its status."
  def ending(port, said) do
    receive do
      {^port, {:data, more}} -> ending(port, said <> more)
      {^port, {:exit_status, status}} -> {said, status}
    after
      60_000 -> flunk("the demo goes on: " <> said)
    end
  end

  @doc "The process of a node, as the run has told it."
  def pid(said, name) do
    [_line, pid] = Regex.run(~r/^#{name} +pid (\d+) node #{name}@/m, said)
    pid
  end

  @doc "The ports at which the nodes of the run listen, by their names, as its port mapper has them."
  def listening(env) do
    {names, 0} = System.cmd("epmd", ["-names"], env: env)

    for [_line, name, port] <- Regex.scan(~r/^name (\w+) at port (\d+)$/m, names),
        into: %{},
        do: {name, String.to_integer(port)}
  end

  @doc "Whether a node that listens there answers a caller of this name, which it must make an atom for."
  def greeted?(port, name) do
    # The message that opens the handshake, its flags those of OTP 23 and later.
    hello = <<?N, 0xD07FBD::64, 1::32, byte_size(name)::16, name::binary>>

    # One that is refused may be reset before we know that it was accepted.
    with {:ok, socket} <-
           :gen_tcp.connect({127, 0, 0, 1}, port, [:binary, packet: 2, active: false]) do
      :gen_tcp.send(socket, hello)
      answer = :gen_tcp.recv(socket, 0, 5_000)
      :gen_tcp.close(socket)
      match?({:ok, <<?s, _::binary>>}, answer)
    else
      {:error, _refused} -> false
    end
  end

  @doc "Ends a process, as `kill -9` does."
  def kill(pid), do: {_text, 0} = System.cmd("kill", ["-KILL", pid])
  @doc "Whether there is such a process."
  def there?(pid), do: match?({_, 0}, System.cmd("kill", ["-0", pid], stderr_to_stdout: true))

  @doc "Whether the port mapper that the run started is still there."
  def mapped?(env),
    do: match?({_, 0}, System.cmd("epmd", ["-names"], env: env, stderr_to_stdout: true))

  @doc "Waits until it is not."
  def unmapped(env, deadline) do
    if mapped?(env) do
      assert System.monotonic_time(:millisecond) < deadline, "its epmd goes on"
      pause()
      unmapped(env, deadline)
    end
  end

  @doc "Waits until this folder is gone."
  def removed(folder, deadline) do
    if File.exists?(folder) do
      assert System.monotonic_time(:millisecond) < deadline, "#{folder} is still there"
      pause()
      removed(folder, deadline)
    end
  end

  @doc "Waits until these processes are gone."
  def ended(processes, deadline) do
    case Enum.filter(processes, &there?/1) do
      [] ->
        :ok

      left ->
        assert System.monotonic_time(:millisecond) < deadline, "#{inspect(left)} go on"
        pause()
        ended(left, deadline)
    end
  end

  # Whoever asks without a pause keeps those that end from the processor.
  defp pause, do: receive(do: (:never -> :ok), after: (50 -> :ok))
end
