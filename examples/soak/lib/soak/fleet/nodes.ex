defmodule Soak.Fleet.Nodes do
  @moduledoc "Describes what it means for a run of `bin/soak` that a node has come up or ended. No process."
  alias Soak.State

  # A robot that has used up its restarts is ended by its supervisors, and its node with it, within this time.
  @given_up_us 10_000_000

  @doc "Takes what a keeper says of its node."
  @spec kept(State.t(), atom(), tuple()) :: State.t()
  def kept(s, :world, {:up, vm, us}),
    do: s |> there(:world, vm) |> State.note({us, :soak, :world, :up})

  def kept(s, :world, {:down, _words, us}),
    do: s |> gone(:world) |> State.note({us, :soak, :world, :down})

  def kept(s, name, {:up, vm, us}), do: s |> there(name, vm) |> State.note({us, :soak, :up, name})

  def kept(s, name, {:down, words, us}) do
    s = s |> gone(name) |> State.note({us, :soak, :down, name})
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

  def kept(s, name, {:orphans, lines, us}),
    do: State.note(s, {us, :soak, :orphans, {name, lines}})

  def kept(s, name, {:failed, reason, _us}) do
    s = %{s | ended: Map.put(s.ended, name, :failed)}

    State.violation(
      s,
      "#{name} has not started: #{inspect(reason, limit: 10, printable_limit: 200)}"
    )
  end

  defp there(s, name, vm),
    do: State.write(%{s | vms: Map.put(s.vms, name, vm)}, "#{name} is up, pid #{vm.pid}")

  defp gone(s, name),
    do:
      State.write(
        %{s | vms: Map.delete(s.vms, name), frozen: MapSet.delete(s.frozen, name)},
        "#{name} is down"
      )
end
