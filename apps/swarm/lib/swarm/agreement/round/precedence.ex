defmodule Swarm.Agreement.Round.Precedence do
  @moduledoc false
  # Decides which of two rounds counts, by their ids `{epoch, counter, initiator}`: the higher one, unless
  # this robot's digest is out. Pure.
  alias Swarm.Agreement.Round
  alias Swarm.Agreement.Round.{Letter, Tally}

  @doc """
  The epoch and the counter of the next round for this epoch. If the counter has reached its end,
  a new epoch begins.

      iex> alias Swarm.Agreement.Round.Precedence
      iex> for highest <- [{2, 1}, {3, 4}, {5, 1}, {3, 1_000_000}], do: Precedence.next(3, highest)
      [{3, 2}, {3, 5}, {5, 1}, {4, 1}]
  """
  @spec next(pos_integer(), {non_neg_integer(), non_neg_integer()}) ::
          {pos_integer(), pos_integer()}
  def next(epoch, {top, _counter}) when epoch < top, do: {top, 1}

  def next(epoch, {_top, counter}),
    do: if(counter < Letter.tries(), do: {epoch, counter + 1}, else: {epoch + 1, 1})

  @doc "Notes that there is a round of this id."
  @spec note(Round.t(), Letter.id()) :: Round.t()
  def note(round, {epoch, counter, _initiator}), do: raised(round, {epoch, counter})

  @doc """
  If this robot's digest is out, others may have committed the round, so the next round is for a
  new epoch.
  """
  @spec fenced(Round.t()) :: Round.t()
  def fenced(%{phase: phase, id: {epoch, _counter, _initiator}} = round)
      when phase in [:digest, :committed],
      do: raised(round, {epoch + 1, 0})

  def fenced(round), do: round

  defp raised(round, numbers), do: %{round | highest: max(round.highest, numbers)}

  @doc """
  Whether a round of this id takes the place of the one that the robot is in.

  A robot that has sent its digest joins another round of the same epoch only if the sender has
  not sent any digest; otherwise two rounds could found the same epoch.
  """
  @spec supersedes?(Letter.id(), Round.t()) :: boolean()
  def supersedes?(_id, %{id: nil}), do: true

  def supersedes?({epoch, _counter, initiator} = id, %{id: {own, _, _}} = round) do
    case round.phase do
      :committed -> epoch > own
      :digest -> epoch > own or (id > round.id and Tally.unsigned?(round, initiator))
      _open_or_left -> id > round.id
    end
  end
end
