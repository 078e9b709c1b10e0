defmodule Missions.Patrol.Helping do
  @moduledoc """
  Decides by rules (`Swarm.Rules`) which robot visits which point, and which robot helps which: an alternative to
  `Missions.Patrol.Motivation` and `Missions.Patrol.Auction`. Pure.

  Each tick every robot draws the same conclusions by itself, from what all have told:

  | fact | means |
  |---|---|
  | `near(far_m, robot, point)` | how far one of the 20 nearest free robots is from a point that is due |
  | `due(point)` | the point is due |
  | `visits(robot, point, busy_s)` | a robot is at a point, for so long |
  | `silent(robot, point)` | a robot was at a point, and has said nothing for 5 s |

  A robot that is at a point for 30 s does not get there; that it gives way, and that no other waits for it any longer, is that of the motivations
  (`Missions.Patrol.Motivation.keep/5`). Proposals are carried out in their order, so that each robot and each point is taken once.
  """
  use Swarm.Rules
  alias Missions.Patrol.{Auction, Motivation}
  alias Swarm.Rules

  # Of so many free robots, the nearest to a point, the rules hear: those of a thousand for 64 points would conclude more than they may.
  @nearest 20

  rule "what a silent robot was at needs help", priority: 20 do
    silent(robot, point)
    conclude(needs_help(robot, point))
  end

  rule "what a robot does not reach needs help", priority: 20 do
    visits(robot, point, busy_s)
    where(busy_s >= 30)
    conclude(needs_help(robot, point))
  end

  rule "the nearest free robot helps", priority: 20 do
    near(_far_m, helper, point)
    needs_help(robot, point)
    where(helper != robot)
    propose(take(helper, point))
  end

  rule "the nearest free robot takes a point that is due" do
    near(_far_m, helper, point)
    due(point)
    absent(visits(_robot, point, _busy_s))
    propose(take(helper, point))
  end

  @doc """
  One tick of this robot, as in `Missions.Patrol.Auction.tick/6`; besides the motivation, the lines that say why it has taken a point now, `nil` if it has
  not.
  """
  @spec tick(
          Motivation.t(),
          atom(),
          [Motivation.task()],
          %{atom() => Motivation.peer()},
          integer(),
          Auction.bids()
        ) :: {Motivation.t(), [String.t()] | nil}
  def tick(motivation, me, tasks, peers, now_ms, bids) do
    {heard, silent} =
      Enum.split_with(peers, fn {_id, peer} -> Motivation.heard?(peer, now_ms) end)

    motivation = Motivation.keep(motivation, me, tasks, heard, now_ms)

    with %{active: nil} <- motivation,
         facts = facts(me, tasks, heard, silent, now_ms, bids),
         {:ok, result} <- Rules.run(rules(), facts),
         proposed = for(%{fact: {"take", id, point}} <- result.proposals, do: {id, point}),
         %{^me => point} <- Auction.first(proposed) do
      why = Rules.why(result, {"take", me, point})
      {%{motivation | active: point, since_ms: now_ms}, why}
    else
      _busy_or_without -> {motivation, nil}
    end
  end

  defp facts(me, tasks, heard, silent, now_ms, bids) do
    due = for %{needed?: true, number: number} <- tasks, do: number
    free = for {id, %{doing: nil}} <- heard, do: id
    own = Map.new(tasks, &{&1.number, &1.far})

    bids = bids |> Map.take(free) |> Map.put(me, own)
    near = for number <- due, {far, id} <- nearest(bids, number), do: {:near, far, id, number}

    visits =
      for {id, %{doing: number} = peer} <- heard,
          number != nil,
          do: {:visits, id, number, div(peer.busy_ms + now_ms - peer.at_ms, 1_000)}

    lost = for {id, %{doing: number}} <- silent, number != nil, do: {:silent, id, number}
    Enum.map(due, &{:due, &1}) ++ near ++ visits ++ lost
  end

  defp nearest(bids, number) do
    far = for {id, costs} <- bids, far = costs[number], do: {Float.round(far * 1.0, 1), id}
    far |> Enum.sort() |> Enum.take(@nearest)
  end
end
