defmodule Sim.Fleet.Nodes.Host do
  @moduledoc """
  Makes this process of the operating system the node that starts others, on the loopback interface.

  The cookie of a run is drawn at random and kept in a folder of its own, which only this user can
  read; the nodes are given that folder as their home, where Erlang looks for it. So it is in no
  command line and no environment.
  """

  @host "127.0.0.1"
  @name :"demo@127.0.0.1"

  @enforce_keys [:home]
  defstruct @enforce_keys

  @type t :: %__MODULE__{home: Path.t()}

  @doc "The host part of all nodes' names."
  @spec host() :: String.t()
  def host, do: @host

  @doc "Becomes a node, with a cookie for this run."
  @spec start() :: {:ok, t()} | {:error, line :: String.t()}
  def start do
    if Node.alive?(), do: home(Node.get_cookie()), else: become_node()
  end

  @doc "Takes the run's folder away."
  @spec stop(t()) :: :ok
  def stop(%__MODULE__{home: home}) do
    _ = File.rm_rf(home)
    :ok
  end

  defp become_node do
    Application.put_env(:kernel, :inet_dist_use_interface, {127, 0, 0, 1})
    epmd()

    case quietly(fn -> Node.start(@name, :longnames) end) do
      {:ok, _kernel} ->
        # Our own random number, not a text from outside.
        cookie = :"#{Base.encode32(:crypto.strong_rand_bytes(20), padding: false)}"
        Node.set_cookie(cookie)
        home(cookie)

      {:error, _reason} ->
        {:error,
         "no nodes can be started here: #{@name} is taken by another run, or epmd does not " <>
           "answer (see: epmd -names)"}
    end
  end

  # A daemon, which does not hold our terminal; where one is running this does nothing.
  defp epmd do
    program = System.find_executable("epmd") || Path.join(erts(), "epmd")
    environment = [{"ERL_EPMD_ADDRESS", @host}]
    if File.exists?(program), do: System.cmd(program, ["-daemon"], env: environment)
  end

  defp erts, do: Path.join([:code.root_dir(), "erts-#{:erlang.system_info(:version)}", "bin"])

  # The kernel tells all about a failure; one line is enough.
  defp quietly(function) do
    level = :logger.get_primary_config().level
    :logger.set_primary_config(:level, :none)
    result = function.()
    :logger.set_primary_config(:level, level)
    result
  end

  defp home(cookie) do
    sweep(System.tmp_dir!())
    number = Base.encode16(:crypto.strong_rand_bytes(4), case: :lower)
    home = Path.join(System.tmp_dir!(), "convoy-#{System.pid()}-#{number}")
    file = Path.join(home, ".erlang.cookie")

    with :ok <- File.mkdir(home),
         :ok <- File.chmod(home, 0o700),
         :ok <- File.write(file, Atom.to_string(cookie)),
         :ok <- File.chmod(file, 0o400) do
      System.at_exit(fn _status -> File.rm_rf(home) end)
      {:ok, %__MODULE__{home: home}}
    else
      {:error, reason} -> {:error, "#{home} cannot be made: #{:file.format_error(reason)}"}
    end
  end

  # What runs left that were killed: their number is in the name, and their cookie is worth nothing.
  defp sweep(folder) do
    with true <- File.dir?("/proc/self"), {:ok, names} <- File.ls(folder) do
      for name <- names,
          [_all, pid] <- [Regex.run(~r/^convoy-(\d+)-[0-9a-f]{8}$/, name)],
          not File.dir?("/proc/#{pid}"),
          do: File.rm_rf(Path.join(folder, name))
    end
  end
end
