defmodule Sim.Fleet.Nodes.Child do
  @moduledoc """
  A node that we started: its process of the operating system behind a port. It lives no longer than
  we do: its standard input closes with us, and the leash (`c_src/leash.c`) ends it even when it is
  frozen.
  """
  alias Sim.Fleet.Nodes.Command
  alias Sim.Node.Config

  # With the shell, for those who attach.
  @apps [:elixir, :iex, :logger, :hal, :vision, :robot, :mesh, :swarm, :missions, :sim]
  @own_flags ~w(ERL_FLAGS ERL_AFLAGS ERL_ZFLAGS ELIXIR_ERL_OPTIONS)
  @kept_bytes 4_000
  @end_ms 2_000

  @enforce_keys [:node, :port, :pid]
  defstruct @enforce_keys ++ [up: nil, said: ""]

  @typedoc "`up` holds what it told when it was there; `said` the last of what it printed."
  @type t :: %__MODULE__{
          node: node(),
          port: port(),
          pid: pos_integer(),
          up: map() | nil,
          said: String.t()
        }

  @doc "Starts a node, in the calling process; `home` holds its cookie."
  @spec start(Config.t(), Path.t()) :: {:ok, t()} | {:error, line :: String.t()}
  def start(%Config{} = config, home) do
    leash = Application.app_dir(:sim, "priv/leash")
    erl = System.find_executable("erl") || Path.join([:code.root_dir(), "bin", "erl"])

    environment =
      [{~c"HOME", to_charlist(home)}, {~c"ERL_CRASH_DUMP_BYTES", ~c"0"}] ++
        for(v <- @own_flags, do: {to_charlist(v), false})

    formations = Application.get_env(:swarm, :formations, [])
    arguments = [erl | Command.arguments(folders(formations), formations)]
    options = [:binary, :exit_status, :stderr_to_stdout, args: arguments, env: environment]
    port = Port.open({:spawn_executable, leash}, options)

    case Port.info(port, :os_pid) do
      {:os_pid, pid} ->
        true = Port.command(port, Config.line(config))
        {:ok, %__MODULE__{node: config.node, port: port, pid: pid}}

      nil ->
        {:error, "#{config.node} cannot be started: #{leash} #{erl} does not run"}
    end
  end

  @doc "It printed something."
  @spec said(t(), binary()) :: t()
  def said(child, text) do
    all = child.said <> text
    size = byte_size(all)
    kept = min(size, @kept_bytes)
    %{child | said: binary_part(all, size - kept, kept)}
  end

  @doc "The last line that it printed, for a message to people."
  @spec last_line(t()) :: String.t()
  def last_line(child) do
    case child.said |> String.split("\n", trim: true) |> List.last() do
      nil ->
        "it printed nothing"

      line ->
        if String.valid?(line), do: String.slice(line, 0, 200), else: inspect(line, limit: 200)
    end
  end

  @doc "Kills it, frozen or not, and without asking it."
  @spec kill(t()) :: :ok
  def kill(child) do
    _ = System.cmd("kill", ["-KILL", Integer.to_string(child.pid)], stderr_to_stdout: true)
    :ok
  end

  @doc """
  Waits until these, which were killed, are gone, 2 s at most: whoever looks for them after we have
  ended finds none. In the process that started them.
  """
  @spec await_ends([t()]) :: :ok
  def await_ends(children) do
    await(for(child <- children, do: child.port), System.monotonic_time(:millisecond) + @end_ms)
  end

  defp await([], _deadline), do: :ok

  defp await([port | ports], deadline) do
    receive do
      {^port, {:exit_status, _status}} -> await(ports, deadline)
    after
      max(deadline - System.monotonic_time(:millisecond), 0) -> await(ports, deadline)
    end
  end

  # Those of this build: what runs here runs there.
  defp folders(formations) do
    consolidated =
      for path <- :code.get_path(), List.to_string(path) =~ ~r"consolidated$", do: path

    apps = for app <- @apps, do: Path.join(to_string(:code.lib_dir(app)), "ebin")
    # Formations of a build's own are in apps of its own.
    added = for {_kind, module} <- formations, path = :code.which(module), is_list(path), do: path

    Enum.map(consolidated, &List.to_string/1) ++
      apps ++ Enum.uniq(Enum.map(added, &Path.dirname/1))
  end
end
