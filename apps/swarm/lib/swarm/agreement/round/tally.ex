defmodule Swarm.Agreement.Round.Tally do
  @moduledoc false
  # Counts what a robot has heard in a round: the reports and the digests of its view, and whether they are
  # all there and the same. Pure.
  #
  # The first report and the first digest of a robot in a round are final.
  alias Swarm.Agreement.{Election, Round}

  @doc "Takes reports, of which those count that are new and of the view."
  @spec reports(Round.t(), %{atom() => Election.report() | :busy | nil}) :: Round.t()
  def reports(round, reports) do
    news =
      for {id, report} <- reports,
          is_map(report),
          not is_map_key(round.reports, id),
          id in round.view,
          into: %{},
          do: {id, report}

    if news == %{}, do: round, else: %{round | reports: Map.merge(round.reports, news)}
  end

  @doc "Takes the digest of a robot of the view."
  @spec digest(Round.t(), atom(), binary()) :: Round.t()
  def digest(round, from, digest) do
    if from in round.view,
      do: %{round | digests: Map.put_new(round.digests, from, digest)},
      else: round
  end

  @doc "Whether all of the view have reported."
  @spec whole?(Round.t()) :: boolean()
  def whole?(round), do: Enum.all?(round.view, &is_map_key(round.reports, &1))

  @doc "Whether all of the view have sent this robot's own digest."
  @spec agreed?(Round.t()) :: boolean()
  def agreed?(round),
    do: Enum.all?(round.view, &(Map.get(round.digests, &1) == round.digest))

  @doc "Whether any member has sent another digest."
  @spec differing?(Round.t()) :: boolean()
  def differing?(round), do: Enum.any?(round.digests, fn {_id, d} -> d != round.digest end)

  @doc "Whether a robot is of the view and has sent no digest."
  @spec unsigned?(Round.t(), atom()) :: boolean()
  def unsigned?(round, id), do: id in round.view and not is_map_key(round.digests, id)

  @doc "The record of what has been reported, as far as this robot knows."
  @spec record(Round.t()) :: Round.Record.t()
  def record(round),
    do: %Round.Record{
      id: round.id,
      view: round.view,
      reports: Round.Record.freeze(round.view, round.reports),
      digest: round.digest
    }
end
