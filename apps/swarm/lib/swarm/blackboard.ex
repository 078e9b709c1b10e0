defmodule Swarm.Blackboard do
  @moduledoc """
  Shares what the robots of the fleet publish about themselves, and leave for each other (`Swarm.Blackboard.Hints`), on
  every node: `Swarm.Blackboard.State` in one process per node, which all processes can read without asking it.

      Swarm.Blackboard.put(:mag1, :door, %{open: true})        # on the node of mag1
      Swarm.Blackboard.get(:mag1, :door, 2_000)                # on any node
      {:ok, %{open: true}, 140}                                # 140 ms old

  What a robot puts is pushed to all other nodes at once. Losses are repaired: once a second each
  node sends a digest of all it has to two others, which answer with what they have for the robots
  that differ, and both send what the other lacks, including rows of third parties. So a row
  reaches nodes that the robot's own node never reaches.

  A robot's rows are written only on its node, after it entered (`enter/2`; its comms process does
  that). They contain the number of its life. An event `[:swarm, :blackboard, :rival]` reports
  another robot of the same name; its rows are not accepted.

  Options of `start_link/1`, with their defaults:

    * `:name` - of the process and its table (`#{inspect(__MODULE__)}`)
    * `:transport` - `{m, f, a}`, called with `a ++ [:rows, term]` for all other nodes and `a ++
      [:rows, node, term]` for one (`{Mesh, :cast, []}`)
    * `:nodes` - `{m, f, a}` that returns the nodes that are alive (in the mesh's view)
    * `:repair_ms` - time between two digests (1,000; `:never` for tests that call `repair/1`)
    * `:limits` - as in `Swarm.Blackboard.State.new/1`
    * `:seed` - of the random choice of nodes (by default a new one each time)
  """
  alias Swarm.Blackboard
  alias Mesh.{Nonblocking, SafeTable}

  @type age :: non_neg_integer()

  @doc "The board as a child."
  @spec child_spec(keyword()) :: Supervisor.child_spec()
  def child_spec(options), do: %{id: __MODULE__, start: {__MODULE__, :start_link, [options]}}

  @doc "Starts a node's board."
  @spec start_link(keyword()) :: GenServer.on_start()
  def start_link(options \\ []) do
    options =
      Keyword.validate!(options, [
        :seed,
        name: __MODULE__,
        transport: {Mesh, :cast, []},
        nodes: {Mesh, :alive, []},
        repair_ms: 1_000,
        limits: []
      ])

    GenServer.start_link(Blackboard.Server, options, name: options[:name])
  end

  @doc """
  A robot of this node begins to write, in the life numbered `boot`, until the calling process
  ends.
  """
  @spec enter(GenServer.server(), atom(), non_neg_integer()) :: :ok | {:error, line :: String.t()}
  def enter(board \\ __MODULE__, robot, boot) when is_atom(robot) and is_integer(boot),
    do: call(board, {:enter, robot, boot, self()})

  @doc "A robot of this node stops writing; its rows stay, and grow old."
  @spec leave(GenServer.server(), atom()) :: :ok
  def leave(board \\ __MODULE__, robot), do: GenServer.cast(board, {:leave, robot})

  @doc """
  Writes a row of a robot of this node, and tells all nodes. The key is an atom or a pair such as
  `{:task, 3}`, the value any term of up to #{59_000} bytes. Errors are one line.
  """
  @spec put(atom(), atom(), Blackboard.Codec.key(), term()) :: :ok | {:error, line :: String.t()}
  def put(board \\ __MODULE__, robot, key, value) do
    if Blackboard.Codec.key?(key),
      do: call(board, {:put, robot, key, Blackboard.Codec.encode(key, value)}),
      else:
        {:error,
         "#{inspect(key)} is not a key of a row; write a name such as :door or {:task, 3}"}
  end

  @doc false
  # The writes of a robot's comms process, at most ten times a second: enters, writes, and waits
  # for nothing.
  @spec note(atom(), atom(), non_neg_integer(), [{Blackboard.Codec.key(), term()}]) :: :ok
  def note(board \\ __MODULE__, robot, boot, pairs) do
    pairs = for {key, value} <- pairs, do: {key, Blackboard.Codec.encode(key, value)}
    GenServer.cast(board, {:note, self(), robot, boot, pairs})
  end

  @doc """
  The last value of a robot under this key, with its age in ms, unless that is over `max_age_ms`.
  """
  @spec get(atom(), atom(), Blackboard.Codec.key(), age() | :infinity) ::
          {:ok, term(), age()} | :error
  def get(board \\ __MODULE__, robot, key, max_age_ms) do
    with [{_, payload, at_ms, _}] <- SafeTable.lookup(board, {robot, Blackboard.Codec.id(key)}),
         age when age <= max_age_ms <- age(at_ms),
         # Two keys may have the same number.
         {:ok, ^key, value} <- Blackboard.Codec.decode(payload) do
      {:ok, value, age}
    else
      _none -> :error
    end
  end

  @doc "All rows of a robot, by key, with their ages in ms."
  @spec rows(atom(), atom()) :: %{Blackboard.Codec.key() => {term(), age()}}
  def rows(board \\ __MODULE__, robot) do
    for {_, payload, at_ms, _} <-
          SafeTable.select(board, [{{{robot, :_}, :_, :_, :_}, [], [:"$_"]}]),
        {:ok, key, value} <- [Blackboard.Codec.decode(payload)],
        into: %{},
        do: {key, {value, age(at_ms)}}
  end

  @doc "The names of all robots that have a row, sorted."
  @spec robots(atom()) :: [atom()]
  def robots(board \\ __MODULE__),
    do:
      board
      |> SafeTable.select([{{{:"$1", :_}, :_, :_, :_}, [{:is_atom, :"$1"}], [:"$1"]}])
      |> Enum.uniq()
      |> Enum.sort()

  @doc "Passes on a term that arrived from another node."
  @spec hear(GenServer.server(), node(), term()) :: :ok
  def hear(board \\ __MODULE__, node, term), do: GenServer.cast(board, {:hear, node, term})

  @doc "Sends a digest to two other nodes now."
  @spec repair(GenServer.server()) :: :ok
  def repair(board \\ __MODULE__), do: GenServer.cast(board, :repair)

  @doc "How many robots, rows and hints there are, and what was dropped, for people and tests."
  @spec info(GenServer.server()) :: map() | {:error, line :: String.t()}
  def info(board \\ __MODULE__), do: call(board, :info)

  defp call(board, request), do: Nonblocking.call(board, request, "the blackboard of this node")

  defp age(at_ms), do: max(Hal.Clock.now_ms() - at_ms, 0)
end
