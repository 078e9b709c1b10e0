defmodule Mesh.Options do
  @moduledoc """
  What a node's mesh is started with, checked once.

  | option | |
  |---|---|
  | `secret_file` | the fleet's secret (`mix fleet.secret` makes one), or `secret`, as loaded; default: where `Mesh.Secret` looks |
  | `fleet` | the names of all robots that there may be; default `mag1` to `mag100`, `min1` to `min100` |
  | `interface` | the address to listen on and to send from; default all |
  | `port` | the UDP port; default 4370, 0 takes any |
  | `multicast` | group and port of the gossip, default `{{239, 255, 67, 86}, 4371}`; `false` for none |
  | `peers` | addresses to try, `["10.0.0.7:4370"]`, where multicast is blocked |
  | `strategies` | further ways to meet, `[{Module, options}]` (`Mesh.Strategy`) |
  | `topologies` | those of `libcluster`, where it is (`MIX_TARGET`): any of its strategies then connects nodes |
  | `dist_port` | the port that this node's distribution listens on; default: that of `Mesh.Distribution.Epmd`, or 0 where there is an epmd to ask |
  | `full_mesh` | up to so many nodes each is connected to each; default 30 |
  | `degree` | above that, to about so many others, 2 to 30; default 8 |
  """
  alias Mesh.{Roster, Secret, Strategy}

  @defaults [
    secret: nil,
    secret_file: nil,
    fleet: nil,
    interface: {0, 0, 0, 0},
    port: 4370,
    multicast: {{239, 255, 67, 86}, 4371},
    peers: [],
    strategies: [],
    topologies: [],
    dist_port: nil,
    full_mesh: 30,
    degree: 8
  ]

  defstruct Keyword.keys(@defaults) ++ [started: []]

  @typedoc "Checked: `started` are the strategies with their states, and nothing that is needed is `nil` any more."
  @type t :: %__MODULE__{
          secret: Secret.t(),
          secret_file: Path.t() | nil,
          fleet: [atom(), ...],
          interface: :inet.ip4_address(),
          port: :inet.port_number(),
          multicast: Strategy.address() | false,
          peers: [Strategy.address() | String.t()],
          strategies: [{module(), term()}],
          topologies: keyword(),
          dist_port: :inet.port_number(),
          full_mesh: pos_integer(),
          degree: pos_integer(),
          started: [{module(), state :: term()}]
        }

  @doc "Checks options; an error is one line that names the option and what is allowed."
  @spec new(keyword()) :: {:ok, t()} | {:error, String.t()}
  def new(options) do
    with :ok <- known(options),
         options = struct!(__MODULE__, Keyword.merge(@defaults, options)),
         {:ok, secret} <- secret(options),
         fleet = options.fleet || Roster.fleet(),
         :ok <- Roster.check(fleet),
         :ok <- ip(options.interface),
         :ok <- number(:port, options.port, 0..65_535),
         dist_port = options.dist_port || own_port(),
         :ok <- number(:dist_port, dist_port, 0..65_535),
         :ok <- topologies(options.topologies),
         :ok <- number(:full_mesh, options.full_mesh, 2..1_000),
         :ok <- number(:degree, options.degree, 2..30),
         {:ok, started} <- start(options) do
      {:ok, %{options | dist_port: dist_port, secret: secret, fleet: fleet, started: started}}
    end
  end

  @doc """
  Checks what the configuration says, and gives this node the fleet's cookie. A node without a name
  or a secret has no mesh, and the line says which is missing.
  """
  @spec prepare(keyword()) :: {:ok, t()} | {:error, String.t()}
  def prepare(options) do
    with {:ok, options} <- new(options),
         :ok <- Secret.apply_cookie(options.secret),
         do: {:ok, options}
  end

  defp known(options) do
    case Keyword.keyword?(options) && Keyword.keys(options) -- Keyword.keys(@defaults) do
      false ->
        {:error,
         "mesh takes options such as [secret_file: \"…\"], not #{inspect(options, limit: 3)}"}

      [] ->
        :ok

      [key | _] ->
        {:error,
         "mesh has no option #{inspect(key)}; it has #{Enum.join(Keyword.keys(@defaults), ", ")}"}
    end
  end

  defp secret(%{secret: %Secret{} = secret}), do: {:ok, secret}
  defp secret(%{secret: nil, secret_file: nil}), do: Secret.from_env()
  defp secret(%{secret: nil, secret_file: file}) when is_binary(file), do: Secret.load(file)
  defp secret(_other), do: {:error, "mesh secret_file is the path of the fleet's secret"}

  defp ip({a, b, c, d}) when a in 0..255 and b in 0..255 and c in 0..255 and d in 0..255, do: :ok

  defp ip(other),
    do: {:error, "mesh interface is an IPv4 address such as {10, 0, 0, 7}, not #{inspect(other)}"}

  defp number(key, value, range) do
    if is_integer(value) and value in range,
      do: :ok,
      else:
        {:error,
         "mesh #{key} is a whole number from #{range.first} to #{range.last}, not #{inspect(value)}"}
  end

  # Without an epmd others are told in beacons.
  defp own_port do
    case :init.get_argument(:epmd_module) do
      {:ok, _without_epmd} ->
        [name | _host] = String.split(Atom.to_string(node()), "@")

        {:ok, port} = Mesh.Distribution.Epmd.listen_port_please(String.to_charlist(name), ~c"")

        port

      :error ->
        0
    end
  end

  defp topologies([]), do: :ok

  defp topologies(topologies) do
    cond do
      not Keyword.keyword?(topologies) ->
        {:error, "mesh topologies are libcluster's: [name: [strategy: Module, config: [...]]]"}

      not Code.ensure_loaded?(Cluster.Supervisor) ->
        {:error,
         "mesh topologies need libcluster; build with MIX_TARGET=robot where Hex is, or use peers"}

      true ->
        :ok
    end
  end

  defp start(options) do
    gossip = if options.multicast == false, do: [], else: [{Strategy.Gossip, options.multicast}]

    static = if options.peers != [], do: [{Strategy.Static, options.peers}], else: []

    with true <-
           is_list(options.strategies) ||
             {:error, "mesh strategies is a list of {Module, options}"} do
      Enum.reduce_while(gossip ++ static ++ options.strategies, {:ok, []}, fn strategy,
                                                                              {:ok, done} ->
        case begin(strategy) do
          {:ok, state} -> {:cont, {:ok, done ++ [state]}}
          {:error, line} -> {:halt, {:error, "mesh #{line}"}}
        end
      end)
    end
  end

  defp begin({module, options}) when is_atom(module) do
    if Code.ensure_loaded?(module) and function_exported?(module, :targets, 4) do
      with {:ok, state} <- module.init(options), do: {:ok, {module, state}}
    else
      {:error, "strategy #{inspect(module)} is no Mesh.Strategy"}
    end
  end

  defp begin(other),
    do: {:error, "strategies are {Module, options}, not #{inspect(other, limit: 3)}"}
end
