defmodule Swarm.Mesh.Table do
  @moduledoc """
  What the mesh knows, as rows of a table that anybody on this node reads without asking: each row by
  itself, so that nobody copies what he does not look at. `Swarm.Mesh.Server` writes them.

  | row | |
  |---|---|
  | `{:server, pid}` | who sends |
  | `{{:robot, robot}, node, boot, sequence, at_ms}` | its newest heartbeat, and from where |
  | `{{:node, node}, heard_ms, onward, hears}` | when a node was last heard, over which connections it reaches others, whom it hears |
  | `{:beyond, robots}` | those of nodes that others hear, and this one does not |
  | `{:number, number}`, `{:rejected, counts}` | as in `t:Swarm.Mesh.view/0`, `Swarm.Mesh.rejected/0` |

  The table goes with the server; in between there is none, which is as an empty one.
  """
  alias Swarm.Directory.SafeTable
  alias Swarm.Mesh.{NodeTable, Roster, Routing}

  @table __MODULE__

  @typedoc "What the rows of nodes were made of, so that only those that change are made anew."
  @type written :: %{NodeTable.name() => {hears :: list(), links :: list()}}

  @doc "Makes the table; it is the calling process's."
  @spec new() :: written()
  def new do
    @table = :ets.new(@table, [:named_table, :protected, read_concurrency: true])
    true = :ets.insert(@table, {:server, self()})
    %{}
  end

  @doc "A heartbeat of a robot on that node."
  @spec beat(atom(), node(), {integer(), non_neg_integer()}, integer()) :: true
  def beat(robot, node, {boot, sequence}, now_ms),
    do: :ets.insert(@table, {{:robot, robot}, node, boot, sequence, now_ms})

  @doc "Writes what has changed since it was written last."
  @spec write(written(), NodeTable.t(), Roster.t(), %{atom() => pos_integer()}, integer()) ::
          written()
  def write(written, node_table, roster, rejected, now_ms) do
    :ets.insert(@table, [
      {:number, node_table.number},
      {:rejected, rejected},
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

  @doc "Whether there is one."
  @spec there?() :: boolean()
  def there?, do: :ets.whereis(@table) != :undefined

  @doc "The second field of a row that has but two: `:server`, `:beyond`, `:number`, `:rejected`."
  @spec value(atom(), default :: term()) :: term()
  def value(key, default) do
    case SafeTable.lookup(@table, key) do
      [{^key, value}] -> value
      [] -> default
    end
  end

  @doc "The newest heartbeat of a robot: from which node, its number, and when."
  @spec robot(atom()) :: {node(), integer(), non_neg_integer(), at_ms :: integer()} | nil
  def robot(robot) do
    case SafeTable.lookup(@table, {:robot, robot}) do
      [{_key, node, boot, sequence, at_ms}] -> {node, boot, sequence, at_ms}
      [] -> nil
    end
  end

  @doc "The robots that were heard since then, and their nodes."
  @spec robots(since_ms :: integer()) :: [{atom(), node()}]
  def robots(since_ms) do
    heard = {{:robot, :"$1"}, :"$2", :_, :_, :"$3"}
    SafeTable.select(@table, [{heard, [{:>=, :"$3", since_ms}], [{{:"$1", :"$2"}}]}])
  end

  @doc "When a node was last heard; `nil` where it never was."
  @spec heard_ms(node()) :: integer() | nil
  def heard_ms(node) do
    case SafeTable.select(@table, [{{{:node, node}, :"$1", :_, :_}, [], [:"$1"]}]) do
      [heard_ms] -> heard_ms
      [] -> nil
    end
  end

  @doc "The nodes that were heard since then."
  @spec nodes(since_ms :: integer()) :: [node()]
  def nodes(since_ms) do
    heard = {{:node, :"$1"}, :"$2", :_, :_}
    SafeTable.select(@table, [{heard, [{:>=, :"$2", since_ms}], [:"$1"]}])
  end

  @doc "The nodes that were heard since then, and over which connections each reaches others."
  @spec onward(since_ms :: integer()) :: %{node() => [node()]}
  def onward(since_ms) do
    heard = {{:node, :"$1"}, :"$2", :"$3", :_}
    Map.new(SafeTable.select(@table, [{heard, [{:>=, :"$2", since_ms}], [{{:"$1", :"$3"}}]}]))
  end

  @doc "All nodes: when they were last heard, and whom they hear."
  @spec all() :: [{node(), heard_ms :: integer(), hears :: [node()]}]
  def all do
    heard = {{:node, :"$1"}, :"$2", :_, :"$3"}
    SafeTable.select(@table, [{heard, [], [{{:"$1", :"$2", :"$3"}}]}])
  end
end
