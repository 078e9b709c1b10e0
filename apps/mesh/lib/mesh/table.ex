defmodule Mesh.Table do
  @moduledoc """
  Publishes what the mesh knows in an ETS table, one row for each robot and each node, so that readers
  copy only the rows, or the fields, that they need. `Mesh.Server` writes it; every process of this node may read it.

  | row | meaning |
  |---|---|
  | `{:server, pid}` | the process that sends |
  | `{{:robot, robot}, node, boot, sequence, at_ms}` | a robot's newest heartbeat, and its node |
  | `{{:node, node}, heard_ms, onward, hears}` | when a node was last heard, to which nodes it has a working connection, and which nodes it hears |
  | `{:beyond, robots}` | robots on nodes that other nodes hear and this one does not |
  | `{:number, number}`, `{:rejected, counts}`, `{:fault, line}` | as in `t:Mesh.view/0`, `Mesh.rejected/0` and `Mesh.fault/0` |

  The table ends with the server that owns it. Until the next one starts, it reads as empty.
  """
  alias Mesh.SafeTable
  alias Mesh.Protocol.{NodeTable, Roster, Routing}

  @table __MODULE__

  @typedoc "The input of the rows of nodes as last written, so that only rows that change are built again."
  @type written :: %{NodeTable.name() => {hears :: list(), links :: list()}}

  @doc "Creates the table; the calling process owns it."
  @spec new() :: written()
  def new do
    @table = :ets.new(@table, [:named_table, :protected, read_concurrency: true])
    true = :ets.insert(@table, {:server, self()})
    %{}
  end

  @doc "Records a heartbeat of a robot on that node."
  @spec beat(atom(), node(), {integer(), non_neg_integer()}, integer()) :: true
  def beat(robot, node, {boot, sequence}, now_ms),
    do: :ets.insert(@table, {{:robot, robot}, node, boot, sequence, now_ms})

  @doc "Writes what has changed since the last write."
  @spec write(
          written(),
          NodeTable.t(),
          Roster.t(),
          %{atom() => pos_integer()},
          fault :: String.t() | nil,
          integer()
        ) :: written()
  def write(written, node_table, roster, rejected, fault, now_ms) do
    :ets.insert(@table, [
      {:number, node_table.number},
      {:rejected, rejected},
      {:fault, fault},
      {:beyond, Routing.beyond(node_table, now_ms)}
    ])

    Enum.reduce(node_table.nodes, written, &write_node(&2, &1, roster))
  end

  defp write_node(written, {name, entry}, roster) do
    node = Map.fetch!(roster.nodes, name)
    content = {entry.hears, entry.links}

    case written do
      %{^name => ^content} ->
        :ets.update_element(@table, {:node, node}, {2, entry.heard_ms})
        written

      _new_or_changed ->
        onward = nodes(Routing.onward(entry), roster)
        row = {{:node, node}, entry.heard_ms, onward, nodes(entry.hears, roster)}
        :ets.insert(@table, row)
        Map.put(written, name, content)
    end
  end

  defp nodes(names, roster),
    do: for(name <- names, {:ok, node} <- [Roster.node(roster, name)], do: node)

  @doc "Whether the table exists."
  @spec there?() :: boolean()
  def there?, do: :ets.whereis(@table) != :undefined

  @doc "The value of a row with two fields: `:server`, `:beyond`, `:number`, `:rejected` or `:fault`."
  @spec value(atom(), default :: term()) :: term()
  def value(key, default) do
    case SafeTable.lookup(@table, key) do
      [{^key, value}] -> value
      [] -> default
    end
  end

  @doc "The newest heartbeat of a robot: its node, its boot and sequence numbers, and when it was heard."
  @spec robot(atom()) :: {node(), integer(), non_neg_integer(), at_ms :: integer()} | nil
  def robot(robot) do
    case SafeTable.lookup(@table, {:robot, robot}) do
      [{_key, node, boot, sequence, at_ms}] -> {node, boot, sequence, at_ms}
      [] -> nil
    end
  end

  @doc "The robots heard since then, and their nodes."
  @spec robots(since_ms :: integer()) :: [{atom(), node()}]
  def robots(since_ms) do
    heard = {{:robot, :"$1"}, :"$2", :_, :_, :"$3"}
    SafeTable.select(@table, [{heard, [{:>=, :"$3", since_ms}], [{{:"$1", :"$2"}}]}])
  end

  @doc "When a node was last heard; `nil` if it never was."
  @spec heard_ms(node()) :: integer() | nil
  def heard_ms(node) do
    case SafeTable.select(@table, [{{{:node, node}, :"$1", :_, :_}, [], [:"$1"]}]) do
      [heard_ms] -> heard_ms
      [] -> nil
    end
  end

  @doc "The nodes heard since then."
  @spec nodes(since_ms :: integer()) :: [node()]
  def nodes(since_ms) do
    heard = {{:node, :"$1"}, :"$2", :_, :_}
    SafeTable.select(@table, [{heard, [{:>=, :"$2", since_ms}], [:"$1"]}])
  end

  @doc "The nodes heard since then, and to which nodes each has a working connection."
  @spec onward(since_ms :: integer()) :: %{node() => [node()]}
  def onward(since_ms) do
    heard = {{:node, :"$1"}, :"$2", :"$3", :_}
    Map.new(SafeTable.select(@table, [{heard, [{:>=, :"$2", since_ms}], [{{:"$1", :"$3"}}]}]))
  end

  @doc "All nodes: when each was last heard, and which nodes it hears."
  @spec all() :: [{node(), heard_ms :: integer(), hears :: [node()]}]
  def all do
    heard = {{:node, :"$1"}, :"$2", :_, :"$3"}
    SafeTable.select(@table, [{heard, [], [{{:"$1", :"$2", :"$3"}}]}])
  end
end
