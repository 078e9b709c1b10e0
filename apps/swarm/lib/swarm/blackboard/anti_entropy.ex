defmodule Swarm.Blackboard.AntiEntropy do
  @moduledoc false
  # Finds missing rows in three messages: a digest; the other's stamps where it differs; the rows
  # that are newer here, and a request for those that are missing here. Pure.
  alias Swarm.Blackboard.{Codec, Rows, State}

  @hashes 4_294_967_296

  @typedoc "For each owner a number that identifies the rows one has."
  @type digest :: [{Rows.owner(), non_neg_integer()}]
  @type stamps :: [{Rows.owner(), [{Rows.key(), Rows.stamp()}]}]

  @doc """
  A digest of all rows, sorted by name: one number per owner, equal if all stamps are.

      iex> Swarm.Blackboard.AntiEntropy.digest(Swarm.Blackboard.State.new())
      []
  """
  @spec digest(State.t()) :: digest()
  def digest(state) do
    for {owner, all} <- Enum.sort_by(Rows.owners(state), fn {owner, _} -> Codec.name(owner) end),
        do: {owner, hash(all)}
  end

  @doc """
  The owners for which another node, by its digest, has other rows than this one. The digest may
  be partial, for the names from `first` up to, but not including, `until` (`nil`: to the end).
  """
  @spec differing(State.t(), digest(), first :: String.t(), until :: String.t() | nil) ::
          [Rows.owner()]
  def differing(state, digest, first \\ "", until \\ nil) do
    mine = digest(state)
    {theirs, held} = {Map.new(digest), Map.new(mine)}
    within? = fn name -> name >= first and (until == nil or name < until) end

    for({owner, _hash} <- digest, not is_map_key(held, owner), do: owner) ++
      for {owner, hash} <- mine, within?.(Codec.name(owner)), theirs[owner] != hash, do: owner
  end

  @doc "The stamps of the rows of these owners."
  @spec stamps(State.t(), [Rows.owner()]) :: stamps()
  def stamps(state, owners), do: for(owner <- owners, do: {owner, of(Rows.of(state, owner))})

  @doc """
  The rows that another node with these stamps lacks, and `{owner, key}` of those that are newer
  there.
  """
  @spec diff(State.t(), stamps(), integer()) ::
          {[Rows.row()], wanted :: [{Rows.owner(), Rows.key()}]}
  def diff(state, theirs, now_ms) do
    lacked =
      for {owner, stamps} <- theirs,
          had = Map.new(stamps),
          {_, key, stamp, _, _} = row <- Rows.rows(state, owner, now_ms),
          newer?(stamp, had[key]),
          do: row

    wanted =
      for {owner, stamps} <- theirs,
          mine = state |> Rows.of(owner) |> of() |> Map.new(),
          {key, stamp} <- stamps,
          newer?(stamp, mine[key]),
          do: {owner, key}

    {lacked, wanted}
  end

  defp newer?(stamp, other), do: other == nil or stamp > other

  # The same number on every machine and in every release.
  defp hash(all), do: :erlang.phash2(of(all), @hashes)
  defp of(all), do: Enum.sort(for {key, {stamp, _value, _at_ms}} <- all, do: {key, stamp})
end
