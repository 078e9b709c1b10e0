defmodule Mesh.Distribution.Access do
  @moduledoc """
  Decides which addresses may open a distribution connection. It is asked before anything is read from one, because OTP's
  handshake makes an atom of the name that a caller gives before it asks for the cookie.

  | address | may connect |
  |---|---|
  | of this machine: loopback, or the one that was called | always: shells (`remote`, `rpc`), further nodes |
  | configured: option `allow`, and the addresses of `peers`, `CONVOY_ALLOW` and `CONVOY_PEERS` | always |
  | from which signed datagrams came | for 10 minutes after the last one |
  | any other | never |

  A node with an `interface` (`Mesh.Interface`) lets in only calls to that, or to the loopback.

  Each of these has a rate, too: root of this machine, all others of this machine, each configured network and each
  address that was heard may call 20 times at once, and 10 times a second in the long run. A caller from a port below
  1024 of this machine is root, since the kernel gives these to no other user; the shells of releases do
  (`Mesh.Distribution.CallingAddress`), so that the operator of a robot is let in however often others call.

  Without TLS, names that this node has no atom for have another rate: 20 at once, and then one a second from root,
  from all others of this machine and from all configured networks, where shells come from, but one a minute from all
  addresses that were heard, since the names of robots are known.

  What is known is in a public table of the process that listens, so that it outlives the mesh: `Mesh.Server` writes
  what it hears, and the carrier (`Mesh.Distribution.Listener`) asks. A question costs a few lookups, and a stranger
  leaves nothing in the table. Without a carrier there is no table, nothing asks, and what is told here is dropped.
  """
  alias Mesh.Distribution.Access.{Bucket, Networks}
  alias Mesh.{Interface, SafeTable}

  @table __MODULE__
  @heard_ms 600_000
  @at_once 20
  # A minute.
  @attempts 600
  @reserved 1_024
  @names %{root: 60, local: 60, configured: 60, heard: 1}
  # After so long without an attempt an address has all of them again.
  @full_ms div(60_000 * @at_once, @attempts)
  # More rows than a fleet has addresses: each has one because it was heard, and one for its attempts.
  @most 4_096

  @typedoc """
  Why an address is refused: it is not one of the fleet's, or has called, or by new names, too often; or it has called
  an address of this machine that is not that of its interface.
  """
  @type refusal :: :stranger | :too_often | :new_names | :elsewhere

  @doc "Creates the table, with the interface and the networks of the environment; the calling process owns it."
  @spec open(Interface.t(), [Networks.t()]) :: :ok
  def open(interface, environment) do
    # That of a distribution that was stopped may still be there.
    if there?(), do: :ets.delete(@table)
    @table = :ets.new(@table, [:named_table, :public, read_concurrency: true])
    rows = [interface: interface, environment: environment, options: []]
    true = :ets.insert(@table, rows)
    :ok
  end

  @doc "Whether this node asks, because it was started with the carrier."
  @spec there?() :: boolean()
  def there?, do: :ets.whereis(@table) != :undefined

  @doc "Replaces the networks of the mesh's options."
  @spec configure([Networks.t()]) :: :ok
  def configure(networks) do
    _there? = there?() and SafeTable.insert(@table, options: networks)
    :ok
  end

  @doc "Notes that signed datagrams came from these addresses."
  @spec heard([:inet.ip_address()], integer()) :: :ok
  def heard(addresses, now_ms) do
    if there?() and room?(length(addresses), now_ms),
      do: SafeTable.insert(@table, for(ip <- addresses, do: {{:heard, ip}, now_ms}))

    :ok
  end

  @typedoc "The address and the port that a connection comes from."
  @type from :: {:inet.ip_address(), :inet.port_number()}

  @doc """
  Whether a connection from there may go on, which is then one of its attempts. `called` is the address of this
  node that it called.
  """
  @spec check(from(), called :: :inet.ip_address(), integer()) :: :ok | {:error, refusal()}
  def check(from, called, now_ms) do
    case origin(from, called, now_ms) do
      nil -> {:error, :stranger}
      {_kind, who} -> take_if(called?(called), {:attempts, who}, @attempts, :too_often, now_ms)
    end
  end

  defp take_if(true, key, per_minute, why, now_ms), do: take(key, per_minute, why, now_ms)
  defp take_if(false, _key, _per_minute, _why, _now_ms), do: {:error, :elsewhere}

  defp called?(ip) do
    case SafeTable.lookup(@table, :interface) do
      [interface: interface] -> Interface.called?(interface, ip, &Interface.machine_or_none/0)
      [] -> true
    end
  end

  @doc "Whether a caller that was let in may give this name, which then may become an atom."
  @spec name(charlist(), from(), called :: :inet.ip_address(), integer()) ::
          :ok | {:error, refusal()}
  def name(name, from, called, now_ms) do
    if known?(name) do
      :ok
    else
      case origin(from, called, now_ms) do
        nil -> {:error, :stranger}
        {kind, _who} -> take({:names, kind}, @names[kind], :new_names, now_ms)
      end
    end
  end

  @doc "Whether the address is loopback, configured or heard: one that this node may connect to."
  @spec reachable?(:inet.ip_address(), integer()) :: boolean()
  def reachable?(ip, now_ms), do: origin({ip, @reserved}, nil, now_ms) != nil

  # The caller, whose rate counts: all addresses of this machine are one, and all of a network.
  defp origin({ip, port}, called, now_ms) do
    cond do
      # The kernel drops what comes from elsewhere with an address of this machine, or to its loopback.
      ip == called or loopback?(ip) or loopback?(called) -> local(port)
      heard?(ip, now_ms) -> {:heard, ip}
      network = configured(:options, ip) || configured(:environment, ip) -> {:configured, network}
      true -> nil
    end
  end

  defp local(port) when port < @reserved, do: {:root, :root}
  defp local(_port), do: {:local, :local}

  defp loopback?({127, _, _, _}), do: true
  defp loopback?(_other), do: false

  defp heard?(ip, now_ms) do
    case SafeTable.lookup(@table, {:heard, ip}) do
      [{_key, at_ms}] -> now_ms - at_ms < @heard_ms
      [] -> false
    end
  end

  defp configured(source, ip) do
    case SafeTable.lookup(@table, source) do
      [{^source, networks}] -> Networks.find(networks, ip)
      [] -> nil
    end
  end

  defp known?(name) do
    _atom = List.to_existing_atom(name)
    true
  rescue
    ArgumentError -> false
  end

  defp take(key, per_minute, why, now_ms) do
    bucket =
      case SafeTable.lookup(@table, key) do
        [{^key, milli, at_ms}] -> {milli, at_ms}
        [] -> nil
      end

    with {:ok, {milli, at_ms}} <- Bucket.take(bucket, @at_once, per_minute, now_ms),
         true <- room?(1, now_ms),
         true <- SafeTable.insert(@table, [{key, milli, at_ms}]) do
      :ok
    else
      _none_left_or_full -> {:error, why}
    end
  end

  defp room?(rows, now_ms), do: rows + size() <= @most or rows + forget(now_ms) <= @most

  # What is out of date.
  defp forget(now_ms) do
    _count =
      :ets.select_delete(@table, [
        {{{:heard, :_}, :"$1"}, [{:<, :"$1", now_ms - @heard_ms}], [true]},
        {{{:attempts, :_}, :_, :"$1"}, [{:<, :"$1", now_ms - @full_ms}], [true]}
      ])

    size()
  end

  defp size do
    case :ets.info(@table, :size) do
      :undefined -> 0
      size -> size
    end
  end
end
