defmodule Vm.Fleet do
  @moduledoc """
  Keeps named VMs (`Vm`), each by a process of its own (`Vm.Fleet.Keeper`): starts them beside each other, kills, freezes
  and thaws them, starts them again, and asks them over standard input and output, which no cut of a network touches.

  What a VM runs is its user's: `main` is called with each new VM. So is the network between them: `vm` says through
  which namespace of `Vm.Net` it is started, if through any.

      fleet = Vm.Fleet.start(Vm.Fleet.new(), [%{name: :one, vm: [name: :one], main: &Vm.start_apps(&1, [:swarm])}])
      %{one: :ok} = Vm.Fleet.await(fleet)
      Vm.Fleet.call(fleet, :one, :erlang, :node, [])
      Vm.Fleet.freeze(fleet, :one)

  All end with the process that called `new/1`.
  """
  alias Vm.Fleet.Keeper

  @start_ms 130_000

  @enforce_keys [:table, :same]
  defstruct @enforce_keys

  @type t :: %__MODULE__{}

  @typedoc "`vm` are options of `Vm.start_one/1`."
  @type about :: %{name: atom(), vm: Vm.options(), main: (Vm.t() -> term())}

  @doc """
  A fleet without nodes. Options: `again_ms`, after which a node that has ended is started again, by default never; `mark`, by
  which processes of the operating system are known that a node's n-th life has left behind (`VM_FLEET=MARK.NAME.N` in
  their environment); `tell`, the process that gets `{Vm.Fleet, name, what, at_us}` by the machine's time:

  | what | |
  |---|---|
  | `{:up, vm, answer}` | it runs; the answer is that of `main` |
  | `{:failed, reason}` | `main` has exited; `{:no_vm, reason}`: there was no VM to call it with |
  | `{:down, words, n}` | its n-th life has ended; the last line that it printed |
  """
  @spec new(keyword()) :: t()
  def new(options \\ []) do
    options = Keyword.validate!(options, tell: nil, again_ms: nil, mark: "fleet")
    same = Map.new([owner: self(), tag: __MODULE__] ++ options)
    %__MODULE__{table: :ets.new(__MODULE__, [:public]), same: same}
  end

  @doc "Starts nodes beside each other, those that have been started before again (`revive/3`), and waits for none of them."
  @spec start(t(), [about()]) :: t()
  def start(fleet, nodes) do
    for node <- nodes do
      if :ets.member(fleet.table, node.name) do
        revive(fleet, node.name, node.main)
      else
        {:ok, pid} = node |> Map.merge(fleet.same) |> Keeper.start_link(fleet.table)
        :ets.insert_new(fleet.table, {node.name, pid, nil})
      end
    end

    fleet
  end

  @doc "Waits until these have been started, by default all. What `main` answered, by name; exits if one has failed."
  @spec await(t(), [atom()]) :: %{atom() => term()}
  def await(fleet, names \\ []) do
    names =
      if names == [], do: :ets.select(fleet.table, [{{:"$1", :_, :_}, [], [:"$1"]}]), else: names

    for name <- names, into: %{} do
      case outcome(fleet, name) do
        {:ok, answer} -> {name, answer}
        {:error, reason} -> exit({:not_started, name, reason})
      end
    end
  end

  @doc "Waits until a node has been started: what `main` answered, or why there is none."
  @spec outcome(t(), atom()) :: {:ok, term()} | {:error, reason :: term()}
  def outcome(fleet, name) do
    fleet.table |> :ets.lookup_element(name, 2) |> GenServer.call(:answer, @start_ms)
  catch
    :exit, reason -> {:error, reason}
  end

  @doc "The VM of a node, `nil` while there is none."
  @spec vm(t(), atom()) :: Vm.t() | nil
  def vm(fleet, name), do: :ets.lookup_element(fleet.table, name, 3)

  @doc "Calls a function on a node. Exits as `GenServer.call/3` does."
  @spec call(t(), atom(), module(), atom(), list(), timeout()) :: term()
  def call(fleet, name, m, f, a, timeout \\ 10_000),
    do: Vm.call(vm(fleet, name), m, f, a, timeout)

  @doc "Kills a node, frozen or not, without waiting for its end."
  @spec kill(t(), atom()) :: :ok
  def kill(fleet, name), do: fleet |> alive(name) |> Vm.signal("KILL")

  @doc "Freezes a node: it is there, and silent. All of it stands when this returns."
  @spec freeze(t(), atom()) :: :ok
  def freeze(fleet, name), do: fleet |> alive(name) |> Enum.each(&Vm.freeze/1)

  @doc "Lets a frozen node go on."
  @spec thaw(t(), atom()) :: :ok
  def thaw(fleet, name), do: fleet |> alive(name) |> Vm.signal("CONT")

  defp alive(fleet, name), do: fleet |> vm(name) |> List.wrap()

  @doc "Starts a node again, with another `main` if there is one; one that runs is killed. Waits for nothing (`await/2`)."
  @spec revive(t(), atom(), (Vm.t() -> term()) | nil) :: :ok
  def revive(fleet, name, main \\ nil),
    do: fleet.table |> :ets.lookup_element(name, 2) |> GenServer.cast({:again, main})

  @doc "Ends all nodes, frozen or not, and waits until they are gone. The fleet may be started again."
  @spec stop(t()) :: :ok
  def stop(fleet) do
    kept = :ets.tab2list(fleet.table)

    for {_name, pid, _vm} <- kept do
      Process.unlink(pid)
      monitor = Process.monitor(pid)
      Process.exit(pid, :kill)
      receive do: ({:DOWN, ^monitor, _, _, _} -> :ok)
    end

    # One may have come up meanwhile.
    vms = for {_name, _pid, %Vm{} = vm} <- :ets.tab2list(fleet.table), do: vm
    :ets.delete_all_objects(fleet.table)
    Vm.stop(vms)
  end
end
