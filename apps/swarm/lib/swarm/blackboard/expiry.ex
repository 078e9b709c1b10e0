defmodule Swarm.Blackboard.Expiry do
  @moduledoc false
  # Decides which rows a board forgets once they are ten minutes old: robots of which nothing is newer,
  # words of former lives, and deleted hints; words of this life of this node's own robots never.
  # Pure.
  alias Swarm.Blackboard.{Rows, State}

  @forget_ms 600_000

  @doc "Forgets what is old of these owners."
  @spec forget(State.t(), integer(), [Rows.owner()]) ::
          {State.t(), gone :: [{Rows.owner(), State.key()}]}
  def forget(state, now_ms, owners) do
    gone =
      for owner <- owners,
          all = Rows.of(state, owner),
          old = for({_, {_, _, at_ms}} = row <- all, now_ms - at_ms >= @forget_ms, do: row),
          {key, {stamp, value, _}} <- old,
          past?(state, owner, stamp, value, length(old) == map_size(all)),
          do: {owner, key}

    {Enum.reduce(gone, state, &drop/2), gone}
  end

  defp past?(_state, bucket, _stamp, value, _all?) when is_integer(bucket), do: value == ""

  defp past?(state, robot, {incarnation, _}, _value, all?) do
    {{life, _}, _, _} = Rows.latest(state, robot)
    incarnation < life or (all? and not is_map_key(state.own, robot))
  end

  defp drop({bucket, id}, state) when is_integer(bucket),
    do: %{state | hints: Map.delete(state.hints, id)}

  defp drop({robot, key}, state) do
    case Map.delete(Rows.of(state, robot), key) do
      none when none == %{} -> %{state | robots: Map.delete(state.robots, robot)}
      left -> %{state | robots: Map.put(state.robots, robot, left)}
    end
  end
end
