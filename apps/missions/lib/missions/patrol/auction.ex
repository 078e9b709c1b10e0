defmodule Missions.Patrol.Auction do
  @moduledoc false
  # Decides which robot visits which point, by auction: an alternative to `Missions.Patrol.Motivation`. Pure.
  #
  # Each tick every robot holds the same sequential auction by itself, over what all have told: the points that are due and
  # unattended, and where the free robots are. A bid is the distance; the least one wins its point, then the
  # least of those that are left. So nothing more is sent, and robots that know the same decide the same. A robot that has a
  # point keeps it as with motivations (`Missions.Patrol.Motivation.keep/5`), which also settles what two took at once because
  # they knew different things. Source: Gerkey and Matarić's taxonomy (2004), iterated single-task assignment, greedy.
  alias Missions.Patrol.Motivation

  @typedoc "What each free robot bids for each point, in metres."
  @type bids :: %{atom() => %{non_neg_integer() => float()}}

  @doc "One tick of this robot; `bids` are those of others, whose places are known."
  @spec tick(
          Motivation.t(),
          atom(),
          [Motivation.task()],
          %{atom() => Motivation.peer()},
          integer(),
          bids()
        ) :: Motivation.t()
  def tick(motivation, me, tasks, peers, now_ms, bids) do
    peers = Map.filter(peers, fn {_id, peer} -> Motivation.heard?(peer, now_ms) end)
    motivation = Motivation.keep(motivation, me, tasks, Map.to_list(peers), now_ms)
    taken = for {_id, %{doing: number}} <- peers, number != nil, do: number
    open = for %{needed?: true, number: number} <- tasks, number not in taken, do: number
    free = for {id, %{doing: nil}} <- peers, do: id
    own = Map.new(tasks, &{&1.number, &1.far})

    with %{active: nil} <- motivation,
         %{^me => number} <- bids |> Map.take(free) |> Map.put(me, own) |> award(open) do
      %{motivation | active: number, since_ms: now_ms}
    else
      _busy_or_without -> motivation
    end
  end

  @doc """
  The point of each robot that has won one. Of equal bids that of the robot whose name sorts first wins.

      iex> bids = %{mag1: %{0 => 1.0, 1 => 2.0}, mag2: %{0 => 1.5, 1 => 9.0}}
      iex> Missions.Patrol.Auction.award(bids, [0, 1])
      %{mag1: 0, mag2: 1}
  """
  @spec award(bids(), open :: [non_neg_integer()]) :: %{atom() => non_neg_integer()}
  def award(bids, open) do
    all = for {id, costs} <- bids, number <- open, cost = costs[number], do: {cost, id, number}

    first(for {_cost, id, number} <- Enum.sort(all), do: {id, number})
  end

  @doc """
  Of these pairs of a robot and a point, the best first, those in which neither is taken yet.

      iex> Missions.Patrol.Auction.first([mag1: 0, mag2: 0, mag1: 1, mag2: 1])
      %{mag1: 0, mag2: 1}
  """
  @spec first([{atom(), non_neg_integer()}]) :: %{atom() => non_neg_integer()}
  def first(pairs) do
    {won, _sold} =
      Enum.reduce(pairs, {%{}, MapSet.new()}, fn {id, number}, {won, sold} ->
        if is_map_key(won, id) or number in sold,
          do: {won, sold},
          else: {Map.put(won, id, number), MapSet.put(sold, number)}
      end)

    won
  end
end
