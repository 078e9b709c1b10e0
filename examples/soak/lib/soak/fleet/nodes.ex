defmodule Soak.Fleet.Nodes do
  @moduledoc "Describes what it means for a run of `bin/soak` that a node has come up or ended."
  alias Lab.Node.Log
  alias Soak.Fleet.Processes
  alias Soak.State

  # A robot that has used up its restarts is ended by its supervisors, and its node with it, within this time.
  @given_up_us 10_000_000
  # The kernel tells each child of the death of its parent at once; a busy machine takes its time.
  @orphan_ms 3_000

  @doc "Takes what `Vm.Fleet` says of a node."
  @spec kept(State.t(), atom(), tuple(), us :: integer()) :: State.t()
  def kept(s, :world, {:up, vm, _server}, us),
    do: s |> there(:world, vm) |> State.note({us, :soak, :world, :up})

  def kept(s, :world, {:down, _words, life}, us),
    do: s |> gone(:world, life) |> State.note({us, :soak, :world, :down})

  def kept(s, name, {:up, vm, _facts}, us),
    do: s |> there(name, vm) |> State.note({us, :soak, :up, name})

  def kept(s, name, {:down, words, life}, us) do
    s = s |> gone(name, life) |> State.note({us, :soak, :down, name})
    killed? = is_map_key(s.ended, name)
    broken? = us - Map.get(s.processes, name, 0) < @given_up_us
    s = %{s | ended: Map.delete(s.ended, name), restarts: s.restarts + 1}

    cond do
      killed? ->
        s

      broken? ->
        State.write(
          %{s | gave_up: s.gave_up + 1},
          "#{name} has given up, past its restart budget: its node has ended (#{words})"
        )

      true ->
        State.violation(s, "the node of #{name} has ended by itself; its last words: #{words}")
    end
  end

  def kept(s, name, {:failed, reason}, _us) do
    s = %{s | ended: Map.put(s.ended, name, :failed)}

    State.violation(
      s,
      "#{name} has not started: #{inspect(reason, limit: 10, printable_limit: 200)}"
    )
  end

  defp there(s, name, vm),
    do: State.write(%{s | vms: Map.put(s.vms, name, vm)}, "#{name} is up, pid #{vm.pid}")

  defp gone(s, name, life) do
    Process.send_after(self(), {:orphans, name, "#{s.mark}.#{name}.#{life}"}, @orphan_ms)
    s = %{s | vms: Map.delete(s.vms, name), frozen: MapSet.delete(s.frozen, name)}
    State.write(s, "#{name} is down")
  end

  @doc "Looks for processes of the operating system that an ended node has left behind, and ends them."
  @spec orphans(State.t(), atom(), mark :: String.t()) :: State.t()
  def orphans(s, name, mark) do
    left = Processes.marked(mark)
    for {pid, _words} <- left, do: Vm.signal(pid, "KILL")
    lines = for {_pid, words} <- left, do: words
    if left == [], do: s, else: State.note(s, {Log.now(), :soak, :orphans, {name, lines}})
  end
end
