defmodule Swarm.Agreement.Round.Epochs do
  @moduledoc """
  Decides which epochs a robot believes others: those that are no farther ahead of what it knows than a
  fleet gets by itself (`Swarm.Wire.CounterGuard`). An epoch that no robot can have reached would
  leave no room for the next ones. Pure.

  The limit is that of the robot's round, because every leadership begins with one; what a mission
  hears of epochs otherwise, in heartbeats and references, counts against the same limit.
  """
  alias Swarm.Agreement.Round
  alias Swarm.Agreement.Round.Letter
  alias Swarm.Wire.CounterGuard

  # A number that several robots say is trusted up to here: there is more room above it than below.
  @trusted 9_007_199_254_740_992

  @doc "The highest epoch that is admitted now."
  @spec allowed(Round.t(), integer()) :: pos_integer()
  def allowed(%{guard: guard, highest: {known, _counter}}, now_ms),
    do: CounterGuard.limit(guard, known, now_ms)

  @doc """
  Admits a round of this id, or returns the highest epoch that is allowed now.

      iex> alias Swarm.Agreement.Round
      iex> round = Round.open(Round.new(:mag1), 1, [:mag1], :search, 100, 0)
      iex> ids = [{1, 3, :mag2}, {1, 2_000_000, :mag2}, {2, 9, :mag2}, {2_000_000, 1, :mag2}]
      iex> for id <- ids, do: elem(Round.Epochs.admit_round(round, id, 0), 0)
      [:ok, :error, :ok, :error]
  """
  @spec admit_round(Round.t(), Letter.id(), integer()) ::
          {:ok, Round.t()} | {:error, allowed :: pos_integer()}
  def admit_round(round, {epoch, counter, _initiator}, now_ms) do
    with {:ok, round} <- admit(round, epoch, now_ms),
         do: if(counter <= Letter.tries(), do: {:ok, round}, else: {:error, epoch})
  end

  @doc "Admits an epoch that was heard of otherwise, or returns the highest that is allowed now."
  @spec admit(Round.t(), non_neg_integer(), integer()) ::
          {:ok, Round.t()} | {:error, allowed :: pos_integer()}
  def admit(%{guard: guard, highest: {known, _counter}} = round, epoch, now_ms) do
    with {:ok, guard} <- CounterGuard.admit(guard, epoch, known, now_ms),
         do: {:ok, %{round | guard: guard}}
  end

  @doc """
  Admits what it can of the epochs that the robots heard now claim, one each.

  If two of them claim an epoch beyond the limit, the lower of these is trusted: this robot is
  new, or was cut off for long. If only one does, the limit approaches it by a step a second, so
  that even a fleet of two with a number raised from outside is joined.

      iex> alias Swarm.Agreement.Round
      iex> round = Round.Epochs.hear(Round.new(:mag1), [7, 5_000_000], 0)
      iex> Round.Epochs.allowed(round, 0)
      1_000_000
      iex> round = Round.Epochs.hear(round, [5_000_001, 5_000_000], 100)
      iex> Round.Epochs.allowed(round, 100)
      6_000_000
  """
  @spec hear(Round.t(), [non_neg_integer()], integer()) :: Round.t()
  def hear(round, [], _now_ms), do: round

  # If the highest is admitted, the others change nothing after it.
  def hear(round, claims, now_ms) do
    highest = Enum.max(claims)

    if highest <= allowed(round, now_ms),
      do: admitted(round, highest, now_ms),
      else: hear_each(round, claims, now_ms)
  end

  defp hear_each(round, claims, now_ms) do
    round = trust(round, Enum.sort(claims, :desc), allowed(round, now_ms))
    allowed = allowed(round, now_ms)

    Enum.reduce(claims, round, fn claim, %{highest: {known, _counter}} = round ->
      if claim <= allowed,
        do: admitted(round, claim, now_ms),
        else: %{round | guard: CounterGuard.approach(round.guard, claim, known, now_ms)}
    end)
  end

  defp admitted(round, claim, now_ms) do
    {:ok, round} = admit(round, claim, now_ms)
    round
  end

  defp trust(round, [_highest, second | _others], allowed) when second > allowed,
    do: %{round | guard: CounterGuard.trust(round.guard, min(second, @trusted))}

  defp trust(round, _claims, _allowed), do: round
end
