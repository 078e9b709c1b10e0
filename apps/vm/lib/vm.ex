defmodule Vm do
  @moduledoc """
  Starts further Erlang VMs with the code of this build: for tests, for benchmarks, and for fleets whose robots are
  processes of their own. No release of a robot has this.

      [one, two] = Vm.start([[name: :one], [name: :two]])
      Vm.call(one, :erlang, :node, [])
      Vm.signal(one, "STOP")

  `start/1` controls them by `:peer`, over standard input and output, which nothing that happens to a network
  touches. Once they have started, they end when the process that started them ends, and with this VM, however that
  ends: a small program (`c_src/leash.c`) asks the kernel to kill them then, frozen or not. `open/2` starts a VM that
  its caller controls itself, behind a port.
  """

  @boot_ms 60_000
  @end_ms 5_000

  @enforce_keys [:peer, :node, :pid]
  defstruct @enforce_keys

  @typedoc "`peer` is the process here that controls it, `pid` its process of the operating system."
  @type t :: %__MODULE__{peer: pid(), node: node(), pid: String.t()}

  @typedoc """
  `:name`, `:host` and `:longnames` are those of `:peer.start/1`; without a name it is no node. `:flags` are more
  arguments of `erl`, `:env` more of its environment, `:through` is a command that starts it, such as
  `["ip", "netns", "exec", "space"]`.
  """
  @type options :: [
          name: atom(),
          host: String.t(),
          longnames: boolean(),
          flags: [String.t()],
          env: [{String.t(), String.t() | false}],
          through: [String.t()]
        ]

  # A robot has little to do: one scheduler, no busy waiting (there are more nodes than processors),
  # and few threads.
  @emulator ~w(+S 1:1 +SDcpu 1:1 +SDio 1 +A 1 +sbwt none +sbwtdcpu none +sbwtdio none)

  # A cut link must not make healthy nodes disconnect from each other, and sending must not open
  # connections.
  @kernel ~w(-kernel prevent_overlapping_partitions false -kernel connect_all false
             -kernel dist_auto_connect never)

  @doc """
  The flags of a node of a fleet, one of many on this machine; `interface` is where it listens, by default on
  loopback only.
  """
  @spec fleet_flags(:inet.ip4_address()) :: [String.t()]
  def fleet_flags(interface \\ {127, 0, 0, 1}) do
    tuple = to_string(:io_lib.format("~0p", [interface]))
    @emulator ++ @kernel ++ ["-kernel", "inet_dist_use_interface", tuple]
  end

  @doc "Starts VMs side by side, since most of a start is waiting. All are up when this returns; it raises if one is not."
  @spec start([options()]) :: [t()]
  def start(all) do
    owner = self()

    all
    |> Enum.map(&Task.async(fn -> boot(&1, owner) end))
    |> Task.await_many(@boot_ms + @end_ms)
  end

  @doc "Starts one."
  @spec start_one(options()) :: t()
  def start_one(options \\ []), do: hd(start([options]))

  defp boot(options, owner) do
    # What it prints comes here, which must be a real device: Elixir asks that.
    Process.group_leader(self(), Process.whereis(:user))
    {flags, options} = Keyword.pop(options, :flags, [])
    {env, options} = Keyword.pop(options, :env, [])
    {through, options} = Keyword.pop(options, :through, [])
    [program | words] = command(through)

    about =
      Map.merge(Map.new(options, &charlist/1), %{
        connection: :standard_io,
        exec: {to_charlist(program), Enum.map(words, &to_charlist/1)},
        args: Enum.map(flags ++ paths(), &to_charlist/1),
        env: variables(env),
        wait_boot: @boot_ms
      })

    {:ok, peer, node} = :peer.start_link(about)
    vm = %__MODULE__{peer: peer, node: node, pid: "#{:peer.call(peer, :os, :getpid, [])}"}
    spawn(fn -> guard(vm, owner) end)
    Process.unlink(peer)
    vm
  end

  defp charlist({:host, host}), do: {:host, to_charlist(host)}
  defp charlist(option), do: option

  defp guard(vm, owner) do
    [ended, gone] = for pid <- [owner, vm.peer], do: Process.monitor(pid)

    receive do
      {:DOWN, ^ended, _, _, _} -> signal(vm, "KILL")
      {:DOWN, ^gone, _, _, _} -> :ok
    end
  end

  @doc "Starts applications there, in which others have been configured: `[app: [key: value]]`."
  @spec start_apps(t(), [atom()], keyword(keyword())) :: :ok
  def start_apps(vm, apps, config \\ []) do
    :ok = call(vm, Application, :put_all_env, [config])
    for app <- apps, do: {:ok, _} = call(vm, Application, :ensure_all_started, [app], @boot_ms)
    :ok
  end

  @doc "Calls a function there, over standard input and output. Exits as `GenServer.call/3` does."
  @spec call(t(), module(), atom(), list(), timeout()) :: term()
  def call(vm, m, f, a, timeout \\ 10_000), do: :peer.call(vm.peer, m, f, a, timeout)

  @doc "Calls a function there, and waits neither for its answer nor for a frozen one."
  @spec cast(t(), module(), atom(), list()) :: :ok
  def cast(vm, m, f, a), do: :peer.cast(vm.peer, m, f, a)

  @doc "Sends a signal to its process of the operating system: KILL, STOP, CONT. One that is gone hears nothing."
  @spec signal(t() | [t()] | (os_pid :: String.t()), String.t()) :: :ok
  def signal(vms, signal) do
    pids = for vm <- List.wrap(vms), do: if(is_binary(vm), do: vm, else: vm.pid)
    _gone = System.cmd("kill", ["-#{signal}" | pids], stderr_to_stdout: true)
    :ok
  end

  @doc "The resident set of its process in bytes, `nil` where it is not known."
  @spec resident(t()) :: pos_integer() | nil
  def resident(vm) do
    with {:ok, text} <- File.read("/proc/#{vm.pid}/status"),
         [_line, kilobytes] <- Regex.run(~r/VmRSS:\s+(\d+)/, text),
         do: 1024 * String.to_integer(kilobytes),
         else: (_unknown -> nil)
  end

  @doc "Freezes it: it is there, and silent. The signal is on its way when `kill` returns, and every thread stops by itself."
  @spec freeze(t()) :: :ok
  def freeze(vm) do
    signal(vm, "STOP")
    await_stopped(vm.pid)
  end

  defp await_stopped(pid, tries \\ 100_000) do
    states = for file <- Path.wildcard("/proc/#{pid}/task/*/stat"), do: state(File.read(file))

    cond do
      Enum.all?(states, &(&1 in ["T", :ended])) -> :ok
      tries == 0 -> raise "process #{pid} does not stop"
      true -> await_stopped(pid, tries - 1)
    end
  end

  # After the name, which is in brackets and may hold anything.
  defp state({:ok, stat}), do: stat |> String.split(") ") |> List.last() |> String.first()
  defp state({:error, _gone}), do: :ended

  @doc "Ends them, frozen or not and without asking them, and waits until they are gone."
  @spec stop(t() | [t()]) :: :ok
  def stop([]), do: :ok

  def stop(vms) do
    signal(vms, "KILL")

    for vm <- List.wrap(vms) do
      monitor = Process.monitor(vm.peer)

      receive do
        {:DOWN, ^monitor, _, _, _} -> :ok
      after
        @end_ms -> exit({:does_not_end, vm})
      end
    end

    :ok
  end

  @doc """
  Starts `erl` with these arguments, and the code of this build, behind a port of the calling process, to which
  what it prints and its exit status come. `error` if it cannot be run.
  """
  @spec open([String.t()], [{String.t(), String.t() | false}]) ::
          {:ok, port(), pid :: pos_integer()} | :error
  def open(arguments, env) do
    [program | words] = command([])
    words = words ++ paths() ++ arguments
    options = [:binary, :exit_status, :stderr_to_stdout, args: words, env: variables(env)]
    port = Port.open({:spawn_executable, program}, options)

    case Port.info(port, :os_pid) do
      {:os_pid, pid} -> {:ok, port, pid}
      nil -> :error
    end
  end

  defp command(through) do
    erl = System.find_executable("erl") || Path.join([:code.root_dir(), "bin", "erl"])
    [Application.app_dir(:vm, "priv/leash") | through] ++ [erl]
  end

  # The code of this build: what runs here runs there. Erlang's own it has itself, unless all is in one place: a
  # release. Consolidated protocols are found before the others. Then come the folders that most of our modules are
  # from: one that is loaded is looked for in each, and a robot's VM loads some 300.
  defp paths do
    all = Enum.map(:code.get_path(), &to_string/1)
    own = Path.join(to_string(:code.root_dir()), "lib")

    case Enum.split_with(all, &String.starts_with?(&1, own)) do
      {erlang, [_, _ | _] = ours} ->
        loaded = Enum.frequencies_by(:code.all_loaded(), &folder/1)
        used = Enum.filter(erlang, &is_map_key(loaded, &1))
        {tools, ours} = Enum.split_with(ours, &tool?/1)
        {protocols, ours} = Enum.split_with(ours, &(Path.basename(&1) == "consolidated"))

        first =
          protocols ++ Enum.sort_by(Enum.reverse(ours) ++ used, &Map.get(loaded, &1, 0), :desc)

        # `erl` turns the order of -pa round.
        ["-pa" | Enum.reverse(first)] ++ ["-pz" | tools]

      {_erlang, _release} ->
        ["-pa" | all]
    end
  end

  defp folder({_module, [_ | _] = file}), do: Path.dirname(to_string(file))
  defp folder(_without_file), do: nil

  # What is loaded here because this VM builds and tests.
  defp tool?(folder), do: folder =~ ~r"/(mix|ex_unit|iex|eex)/ebin$"

  # The settings of our own VM are not for others.
  defp variables(env) do
    own = for name <- ~w(ERL_FLAGS ERL_AFLAGS ERL_ZFLAGS ELIXIR_ERL_OPTIONS), do: {name, false}

    for {name, value} <- own ++ env,
        do: {to_charlist(name), if(value, do: to_charlist(value), else: false)}
  end
end
