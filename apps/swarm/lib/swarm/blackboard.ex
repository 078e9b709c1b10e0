defmodule Swarm.Blackboard do
  @moduledoc """
  What the robots of the fleet tell of themselves, and leave for each other (`Swarm.Blackboard.Hints`), on every
  node: `Swarm.Blackboard.State` in one process a node, readable by all without asking it.

      Swarm.Blackboard.put(:mag1, :door, %{open: true})        # on the node of mag1
      Swarm.Blackboard.get(:mag1, :door, 2_000)                # on any node
      {:ok, %{open: true}, 140}                                # 140 ms old

  What a robot puts is pushed to all other nodes at once. What was lost on the way is repaired: once
  a second each node sends a digest of all it has to two others, which answer with what they have of
  the robots that differ, and both send what the other lacks, of third parties too. So a row comes
  to nodes that the robot's own never reaches.

  A robot's rows are written on its node only, after it entered (`enter/2`; its link does that).
  Its life's number is in them. An event `[:swarm, :blackboard, :rival]` reports another robot of
  the same name; what that one says is not taken over.

  Options of `start_link/1`, with their defaults:

    * `:name` - of the process and its table (`#{inspect(__MODULE__)}`)
    * `:transport` - `{m, f, a}`, called with `a ++ [:rows, term]` for all other nodes and `a ++
      [:rows, node, term]` for one (`{Mesh, :cast, []}`)
    * `:nodes` - `{m, f, a}` that gives the nodes that are alive (of the mesh's view)
    * `:repair_ms` - between two digests (1,000; `:never` for tests that call `repair/1`)
    * `:limits` - as of `Swarm.Blackboard.State.new/1`
    * `:seed` - of the choice of nodes (a new one each time)
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
  A robot of this node begins to write, in the life numbered `boot`; it ends when the calling
  process does.
  """
  @spec enter(GenServer.server(), atom(), non_neg_integer()) :: :ok | {:error, line :: String.t()}
  def enter(board \\ __MODULE__, robot, boot) when is_atom(robot) and is_integer(boot),
    do: call(board, {:enter, robot, boot, self()})

  @doc "A robot of this node writes no more; its rows stay, and grow old."
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
  # What a robot's link tells ten times a second at most: enters, writes, and waits for nothing.
  @spec note(atom(), atom(), non_neg_integer(), [{Blackboard.Codec.key(), term()}]) :: :ok
  def note(board \\ __MODULE__, robot, boot, pairs) do
    pairs = for {key, value} <- pairs, do: {key, Blackboard.Codec.encode(key, value)}
    GenServer.cast(board, {:note, self(), robot, boot, pairs})
  end

  @doc "What a robot wrote last under this key, with its age in ms, unless that is over `max_age_ms`."
  @spec get(atom(), atom(), Blackboard.Codec.key(), age() | :infinity) ::
          {:ok, term(), age()} | :error
  def get(board \\ __MODULE__, robot, key, max_age_ms) do
    with [{_, payload, at_ms, _}] <- SafeTable.lookup(board, {robot, Blackboard.Codec.id(key)}),
         age when age <= max_age_ms <- age(at_ms),
         # Two keys may have one number.
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

  @doc "The names of all robots of which there is a row, sorted."
  @spec robots(atom()) :: [atom()]
  def robots(board \\ __MODULE__),
    do:
      board
      |> SafeTable.select([{{{:"$1", :_}, :_, :_, :_}, [{:is_atom, :"$1"}], [:"$1"]}])
      |> Enum.uniq()
      |> Enum.sort()

  @doc "Something arrived from another node."
  @spec hear(GenServer.server(), node(), term()) :: :ok
  def hear(board \\ __MODULE__, node, term), do: GenServer.cast(board, {:hear, node, term})

  @doc "Sends a digest to two others now."
  @spec repair(GenServer.server()) :: :ok
  def repair(board \\ __MODULE__), do: GenServer.cast(board, :repair)

  @doc "How many robots, rows and hints there are, and what was dropped, for people and tests."
  @spec info(GenServer.server()) :: map() | {:error, line :: String.t()}
  def info(board \\ __MODULE__), do: call(board, :info)

  defp call(board, request), do: Nonblocking.call(board, request, "the blackboard of this node")

  defp age(at_ms), do: max(now() - at_ms, 0)
  defp now, do: System.monotonic_time(:millisecond)
end
