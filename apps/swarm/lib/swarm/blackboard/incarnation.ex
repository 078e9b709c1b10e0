defmodule Swarm.Blackboard.Incarnation do
  @moduledoc """
  Numbers the lives of this node's own robots, each an incarnation: which one a robot writes its rows in, and what
  becomes of rows with its name that come from outside. Pure.

  | row from outside | what happens |
  |---|---|
  | of a former life, or of this one before the board was lost | accepted, but never in place of a newer row |
  | of a higher incarnation, and young | a rival of the same name: reported (`{:rival, robot, incarnation}`), not accepted |
  | of a higher incarnation, and over 5 s old | a former life, before the clock was set back: outbid |
  | of an incarnation that no life can have (`Swarm.Blackboard.Rows.possible?/2`) | refused |
  """
  alias Swarm.Blackboard.{Codec, Rows, State}

  @rival_ms 5_000

  @doc """
  A robot of this node begins to write, in the life numbered `boot`
  (`Swarm.Blackboard.State.enter/4`).
  """
  @spec enter(State.t(), atom(), boot :: non_neg_integer(), integer()) ::
          {State.t(), [State.note()]}
  def enter(state, robot, boot, now_ms) do
    case state.own do
      %{^robot => {^boot, _stamp}} -> {state, []}
      _new -> begin(state, robot, boot, Rows.latest(state, robot), now_ms)
    end
  end

  defp begin(state, robot, boot, {{known, _sequence}, _value, at_ms}, now_ms) when known > boot do
    cond do
      # These are the rows of another robot.
      now_ms - at_ms < @rival_ms -> {alone(state, robot, boot), [{:rival, robot, known}]}
      known < Codec.latest() -> {write(state, robot, boot, {known + 1, state.first}), []}
      # Nothing outbids this number. Other boards forget it, too, when it is old.
      true -> {alone(state, robot, boot), []}
    end
  end

  defp begin(state, robot, boot, {{boot, _} = stamp, _value, _at_ms}, _now_ms),
    do: {write(state, robot, boot, stamp), []}

  defp begin(state, robot, boot, _older, _now_ms),
    do: {write(state, robot, boot, {boot, state.first}), []}

  defp alone(state, robot, boot),
    do:
      write(%{state | robots: Map.delete(state.robots, robot)}, robot, boot, {boot, state.first})

  @doc "Notes the stamp of an own robot's last row."
  @spec write(State.t(), atom(), boot :: non_neg_integer(), Rows.stamp()) :: State.t()
  def write(state, robot, boot, stamp),
    do: %{state | own: Map.put(state.own, robot, {boot, stamp})}

  @doc "A row of an own robot came from outside. Says, too, whether it may be taken."
  @spec hear(State.t(), atom(), State.key(), Rows.held(), integer()) ::
          {State.t(), [State.note()], take? :: boolean()}
  def hear(state, robot, key, {{incarnation, sequence} = stamp, _value, at_ms}, now_ms) do
    {boot, {life, count}} = state.own[robot]

    cond do
      incarnation > life and now_ms - at_ms < @rival_ms ->
        {state, [{:rival, robot, incarnation}], false}

      incarnation > life ->
        {state, notes} = again(state, robot, boot, {incarnation + 1, 0})
        {state, notes, false}

      # This robot's own rows, which the board has lost since: never newer than what it writes
      # now.
      stamp > {life, count} ->
        known? = is_map_key(Rows.of(state, robot), key)
        # Nothing counts this far by itself, so this is treated as another life, with numbers that
        # will last.
        on = if Rows.leap?(sequence, count), do: {life + 1, 0}, else: {life, sequence}
        {state, notes} = again(state, robot, boot, on)
        {state, notes, not known?}

      true ->
        {state, [], true}
    end
  end

  # Old rows keep their order and their ages, and get stamps that win.
  defp again(state, robot, boot, stamp) do
    {_boot, {life, _count}} = state.own[robot]

    {said, former} =
      state |> Rows.of(robot) |> Enum.split_with(&match?({_, {{^life, _}, _, _}}, &1))

    {said, stamp} =
      said
      |> Enum.sort_by(fn {_key, {stamp, _, _}} -> stamp end)
      |> Enum.map_reduce(stamp, fn {key, {_, value, at_ms}}, {incarnation, sequence} ->
        stamp = {incarnation, sequence + 1}
        {{key, {stamp, value, at_ms}}, stamp}
      end)

    state = %{state | robots: Map.put(state.robots, robot, Map.new(said ++ former))}
    notes = for {key, _held} <- said, do: {:changed, robot, key}
    {write(state, robot, boot, stamp), notes ++ [{:again, robot}]}
  end
end
