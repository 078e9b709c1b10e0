defmodule Lab.Fleet.Nodes.Host do
  @moduledoc false
  # Makes this process of the operating system the node that starts others, on the loopback
  # interface, with a mesh of its own through which it hears them.
  #
  # The secret of a run is random and in no file. Nodes get it over their standard input; for people
  # who want to attach, its cookie is in a folder that only this user can read, and that goes with
  # the run however it ends (`Lab.Fleet.Folder`). So it is neither on a command line nor in an
  # environment.
  alias Lab.Fleet.Folder
  alias Lab.Node.Network
  alias Lab.Fleet.Nodes.PortMapper
  alias Mesh.Options

  @address {127, 0, 0, 1}
  @name :"demo@127.0.0.1"

  @enforce_keys [:home, :network, :mesh, :named]
  defstruct @enforce_keys

  @type t :: %__MODULE__{
          home: Path.t(),
          network: Network.t(),
          mesh: pid(),
          named: {:by_us, PortMapper.t()} | :before
        }

  @doc "Makes this process a node with a mesh, for a fleet of these robots and of nodes that are none."
  @spec start([atom()], [atom()]) :: {:ok, t()} | {:error, line :: String.t()}
  def start(robots, others) do
    with :ok <- alone(),
         {:ok, network} <- Network.create(:epmd, robots, [:launcher | others]),
         {:ok, home} <- Folder.make(),
         :ok <- cookie(home, network.secret),
         {:ok, named} <- become_node() do
      with {:ok, options} <- Options.prepare(mesh(network, :launcher)),
           {:ok, mesh} <- Mesh.Supervisor.start_link({options, Swarm.MeshConsumer}) do
        {:ok, %__MODULE__{home: home, network: network, mesh: mesh, named: named}}
      else
        {:error, line} ->
          unname(named)
          {:error, line}
      end
    end
  end

  @doc "The options of a node's mesh. All nodes are connected to all, because the world is one of them."
  @spec mesh(Network.t(), atom()) :: keyword()
  def mesh(network, name), do: Network.mesh(network, name) ++ [full_mesh: 1_000]

  @doc """
  Ends the mesh, removes the run's folder, and gives up the node's name if it got that here.
  """
  @spec stop(t()) :: :ok
  def stop(%__MODULE__{home: home, mesh: mesh, named: named}) do
    if Process.alive?(mesh), do: Supervisor.stop(mesh)
    unname(named)
    Folder.remove(home)
  end

  defp alone do
    if Mesh.running?(),
      do:
        {:error,
         "this node already belongs to a mesh; robots in nodes of their own need another one"},
      else: :ok
  end

  defp become_node do
    if Node.alive?(), do: {:ok, :before}, else: name_node()
  end

  defp name_node do
    Application.put_env(:kernel, :inet_dist_use_interface, @address)
    mapper = PortMapper.start()

    case quietly(fn -> Node.start(@name, :longnames) end) do
      {:ok, _kernel} ->
        {:ok, {:by_us, mapper}}

      {:error, _reason} ->
        PortMapper.stop(mapper)

        {:error,
         "no nodes can be started here: #{@name} is taken by another run, or epmd does not " <>
           "answer (see: epmd -names)"}
    end
  end

  defp unname(:before), do: :ok

  defp unname({:by_us, mapper}) do
    quietly(fn -> Node.stop() end)
    PortMapper.stop(mapper)
  end

  # The kernel logs all details of a failure; one line is enough.
  defp quietly(function) do
    level = :logger.get_primary_config().level
    :logger.set_primary_config(:level, :none)
    result = function.()
    :logger.set_primary_config(:level, level)
    result
  end

  # The folder is this user's alone before there is anything in it.
  defp cookie(home, secret) do
    path = Path.join(home, ".erlang.cookie")

    with :ok <- File.write(path, Atom.to_string(secret.cookie)),
         :ok <- File.chmod(path, 0o400) do
      :ok
    else
      {:error, reason} -> {:error, "#{path} cannot be written: #{:file.format_error(reason)}"}
    end
  end
end
