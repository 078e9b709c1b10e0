defmodule Lab.Trial.Claims do
  @moduledoc """
  Judges each claim of `formed` from outside, by true poses: how far the worst robot was from its
  slot when the leader claimed it, and 5 s later. Pure; fed every 100 ms.

  A claim belongs to one leader, and lasts from when it says `formed` until it no longer does. A
  claim that is withdrawn within the 5 s, for example because the landmark moves, is judged by its
  beginning alone; so is one during which the run ends. A leader without followers claims
  nothing about others, so there is no error to judge.
  """

  @later_ms 5_000
  # Half a metre is about the width of a robot.
  @right_m 0.5

  defstruct standing: %{}, told: []

  @typedoc """
  One claim: when, of which leader, the worst true error in metres then and 5 s later; `nil` if
  there was none to judge.
  """
  @type claim :: %{
          at_s: float(),
          robot: atom(),
          worst_m: float() | nil,
          worst_5s_m: float() | nil
        }

  @typedoc """
  `standing` are the claims that may still be judged after 5 s, by leader; `:judged` once that is
  done. `told` are the others, unordered.
  """
  @type t :: %__MODULE__{
          standing: %{atom() => {since_ms :: integer() | :judged, claim()}},
          told: [claim()]
        }

  @doc "The greatest error of the worst robot, in metres, with which `formed` is true."
  @spec right_m() :: float()
  def right_m, do: @right_m

  @doc """
  One tick: the leaders that claim `formed` now, and a function from a leader to the worst true
  error of its shape, in metres, which is called only when a claim has to be judged.
  """
  @spec note(t(), integer(), [atom()], (atom() -> float() | nil)) :: t()
  def note(claims, at_ms, leaders, worst) do
    {standing, over} = Map.split(claims.standing, leaders)
    kept = Map.new(standing, fn {id, open} -> {id, later(open, at_ms, id, worst)} end)

    new =
      for id <- leaders, not is_map_key(standing, id), into: %{} do
        claim = %{at_s: at_ms / 1000, robot: id, worst_m: worst.(id), worst_5s_m: nil}
        {id, {at_ms, claim}}
      end

    told = for {_id, {_since, claim}} <- over, do: claim
    %{claims | standing: Map.merge(kept, new), told: told ++ claims.told}
  end

  @doc """
  All claims up to now, the oldest first. A run ends 5 s after its last claim, between two ticks,
  so claims that are due then are judged here.
  """
  @spec report(t(), integer(), (atom() -> float() | nil)) :: [claim()]
  def report(claims, at_ms, worst) do
    standing =
      for {id, open} <- claims.standing,
          {_since, claim} = later(open, at_ms, id, worst),
          do: claim

    Enum.sort_by(standing ++ claims.told, &{&1.at_s, &1.robot})
  end

  @doc """
  Whether a claim was true: the error was at most half a metre when it was made, and 5 s later.
  `nil` if no robot followed.

      iex> Lab.Trial.Claims.right?(%{worst_m: 0.2, worst_5s_m: 0.6})
      false
      iex> Lab.Trial.Claims.right?(%{worst_m: 0.2, worst_5s_m: nil})
      true
  """
  @spec right?(%{
          :worst_m => float() | nil,
          :worst_5s_m => float() | nil,
          optional(atom()) => term()
        }) :: boolean() | nil
  def right?(%{worst_m: nil, worst_5s_m: nil}), do: nil

  def right?(%{worst_m: then, worst_5s_m: later}),
    do: Enum.all?([then, later], &(&1 == nil or &1 <= @right_m))

  # The first tick after 5 s have passed.
  defp later({since, claim}, at_ms, id, worst)
       when is_integer(since) and at_ms - since >= @later_ms,
       do: {:judged, %{claim | worst_5s_m: worst.(id)}}

  defp later(open, _at_ms, _id, _worst), do: open
end
