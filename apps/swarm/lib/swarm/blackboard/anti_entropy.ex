defmodule Swarm.Blackboard.AntiEntropy do
  @moduledoc """
  Who lacks which rows, found out in three messages: a digest; the stamps that the other has where it
  differs; the rows that this one has newer, and a wish for those that it has not. Pure.
  """
  alias Swarm.Blackboard

  @hashes 4_294_967_296

  @typedoc "Of each robot a number that says which rows one has."
  @type digest :: [{robot :: atom(), non_neg_integer()}]

  @doc """
  A digest of all rows, sorted by name: one number a robot, equal where all stamps are.

      iex> Swarm.Blackboard.AntiEntropy.digest(Swarm.Blackboard.State.new())
      []
  """
  @spec digest(Blackboard.State.t()) :: digest()
  def digest(rows), do: for({robot, all} <- by_name(rows.robots), do: {robot, hash(all)})

  @doc """
  The robots of which another, by its digest, has other rows than this one. The digest may be a part,
  of the names from `first` up to but without `until` (`nil`: to the end).
  """
  @spec differing(Blackboard.State.t(), digest(), first :: String.t(), until :: String.t() | nil) ::
          [atom()]
  def differing(rows, digest, first \\ "", until \\ nil) do
    theirs = Map.new(digest)
    within? = fn name -> name >= first and (until == nil or name < until) end

    mine =
      for {robot, all} <- by_name(rows.robots),
          within?.(Atom.to_string(robot)),
          do: {robot, hash(all)}

    lacked = for {robot, _hash} <- digest, not is_map_key(rows.robots, robot), do: robot
    lacked ++ for {robot, hash} <- mine, theirs[robot] != hash, do: robot
  end

  @doc "Which rows of these robots one has."
  @spec stamps(Blackboard.State.t(), [atom()]) :: [
          {atom(), [{Blackboard.State.key(), Blackboard.State.stamp()}]}
        ]
  def stamps(rows, robots), do: for(robot <- robots, do: {robot, stamps_of(of(rows, robot))})

  @doc """
  The rows that another lacks who has these; and `{robot, key}` of those that are newer there.
  """
  @spec diff(
          Blackboard.State.t(),
          [{atom(), [{Blackboard.State.key(), Blackboard.State.stamp()}]}],
          integer()
        ) ::
          {[Blackboard.State.row()], wanted :: [{atom(), Blackboard.State.key()}]}
  def diff(rows, theirs, now_ms) do
    {lacked, wanted} =
      for {robot, stamps} <- theirs do
        had = Map.new(stamps)
        mine = of(rows, robot)

        {for(
           {_, key, stamp, _, _} = row <- Blackboard.State.rows(rows, robot, now_ms),
           newer?(stamp, had[key]),
           do: row
         ),
         for(
           {key, stamp} <- stamps,
           newer?(stamp, mine |> Map.get(key) |> stamp()),
           do: {robot, key}
         )}
      end
      |> Enum.unzip()

    {Enum.concat(lacked), Enum.concat(wanted)}
  end

  defp stamp(nil), do: nil
  defp stamp({stamp, _value, _at_ms}), do: stamp

  defp newer?(_stamp, nil), do: true
  defp newer?(stamp, other), do: stamp > other

  defp of(rows, robot), do: Map.get(rows.robots, robot, %{})
  defp by_name(robots), do: Enum.sort_by(robots, fn {robot, _} -> Atom.to_string(robot) end)

  # The same number on every machine and release.
  defp hash(all), do: all |> stamps_of() |> :erlang.phash2(@hashes)
  defp stamps_of(all), do: Enum.sort(for {key, {stamp, _value, _at_ms}} <- all, do: {key, stamp})
end
