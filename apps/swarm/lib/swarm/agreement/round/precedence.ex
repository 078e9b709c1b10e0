defmodule Swarm.Agreement.Round.Precedence do
  @moduledoc """
  Which of two rounds counts, by their ids `{epoch, counter, initiator}`: the higher one, unless
  this robot's digest is out. Pure.
  """
  alias Swarm.Agreement.Round
  alias Swarm.Agreement.Round.{Letter, Tally}

  @leap 1_000_000

  @doc """
  Whether an id is further ahead of the highest known than any fleet gets at once; accepting it
  would leave no room for the next ones.

      iex> alias Swarm.Agreement.Round.Precedence
      iex> ids = [{1, 3, :mag1}, {1, 2_000_000, :mag1}, {2, 9, :mag1}]
      iex> for id <- ids, do: Precedence.leap?(id, {1, 2})
      [false, true, false]
  """
  @spec leap?(Letter.id(), {epoch :: non_neg_integer(), counter :: non_neg_integer()}) ::
          boolean()
  def leap?({epoch, counter, _initiator}, {epoch, highest}), do: counter > highest + @leap

  def leap?({epoch, counter, _initiator}, {highest, _counter}),
    do: epoch > highest + @leap or counter > @leap

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
