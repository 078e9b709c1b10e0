defmodule Missions.Push.Places do
  @moduledoc """
  Decides which robot has which place at the box, and how far it is there. Pure.

  Each tells its ways to the places, and all award them alike, the shortest first (`Missions.Patrol.Auction.award/2`). The one that has a place keeps it unless
  another's way is shorter by a metre. It goes there, `:approach`; it is `:ready`; and it pushes when its partner is ready, too. One that waits for a partner for 6 s
  looks at the box with the others; one that does not get there within 40 s, or pushes for 8 s and does not move, has a wrong idea of how the box lies, and
  forgets it.
  """
  alias Hal.Pose
  alias Missions.Chase.Search
  alias Missions.Patrol.Auction
  alias Missions.Push
  alias Missions.Push.Plan
  alias Robot.Percept

  @fresh_ms 1_000
  @keeps 1.0
  @waits_ms 6_000
  @goes_ms 40_000
  @stuck_ms 8_000
  @step 0.05

  @type stage :: :none | :approach | :ready | :push

  @doc "The robots that were heard within the last second, by name, and what they told."
  @spec fresh(Push.t()) :: [{atom(), Missions.Push.Talk.peer()}]
  def fresh(mission),
    do:
      mission.heard
      |> Enum.filter(fn {_id, peer} -> mission.now_ms - peer.at_ms <= @fresh_ms end)
      |> Enum.sort()

  @doc "In which way and direction the robots push that have places: as the first of them does."
  @spec agreed(Push.t()) :: {:pair | :lone | nil, float() | nil}
  def agreed(mission) do
    told =
      for {id, %{side: side, direction: angle}} <- fresh(mission),
          side != nil,
          angle != nil,
          do: {id, side, angle}

    mine = if mission.side, do: [{mission.me, mission.side, mission.direction}], else: []

    case Enum.sort(told ++ mine) do
      [{_first, 0, direction} | _] -> {:lone, direction}
      [{_first, _side, direction} | _] -> {:pair, direction}
      [] -> {nil, nil}
    end
  end

  @doc "The mission with the place that it wins, and how far it is there."
  @spec take(Push.t(), map(), Robot.Percept.t()) :: Push.t()
  def take(mission, scene, percept),
    do: mission |> claim_side(scene, percept) |> advance(scene, percept)

  defp claim_side(mission, scene, percept) do
    bids = for {id, peer} <- fresh(mission), into: %{}, do: {id, kept(peer.costs, peer.side)}
    own = kept(costs(mission, scene, percept), mission.side)
    won = Auction.award(Map.put(bids, mission.me, own), Plan.sides(scene))
    side = won[mission.me]
    if side == mission.side, do: mission, else: %{mission | side: side, stage: :none, target: nil}
  end

  defp kept(costs, nil), do: costs

  defp kept(costs, side),
    do: for({s, cost} <- costs, into: %{}, do: {s, if(s == side, do: cost - @keeps, else: cost)})

  @doc "Its ways to the places in metres; none of a robot that leaves them to others."
  @spec costs(Push.t(), map(), Robot.Percept.t()) :: %{Plan.side() => float()}
  def costs(%{aside_ms: aside_ms, now_ms: now_ms}, _scene, _percept)
      when aside_ms != nil and now_ms < aside_ms,
      do: %{}

  # One that does not know where it is pushes nothing.
  def costs(_mission, scene, percept) do
    for nil <- [Percept.astray(percept)],
        side <- Plan.sides(scene),
        into: %{},
        do: {side, Pose.distance(percept.pose, Plan.place(scene, side))}
  end

  defp advance(%{side: nil} = mission, _scene, _percept),
    do: %{mission | phase: :watch, stage: :none}

  defp advance(%{side: side} = mission, scene, %{pose: pose}) do
    there? = Plan.pushes?(scene, side, pose)
    partner = partner(mission)

    stage =
      case mission.stage do
        :push ->
          if there? and partner in [:ready, :push], do: :push, else: :approach

        :ready ->
          if not there?,
            do: :approach,
            else: if(partner in [:ready, :push], do: :push, else: :ready)

        _none ->
          if there? and mission.rests? and mission.target != nil, do: :ready, else: :approach
      end

    waits_ms = if stage == :ready and partner == :none, do: mission.waits_ms || mission.now_ms
    goes_ms = if stage == :approach, do: mission.goes_ms || mission.now_ms
    moved = if stage == :push, do: moved(mission.moved, pose, mission.now_ms)
    mission = %{mission | stage: stage, waits_ms: waits_ms, goes_ms: goes_ms, moved: moved}

    cond do
      late?(mission, waits_ms, @waits_ms) ->
        %{rest(mission, :watch) | looks?: true}

      moved != nil and late?(mission, elem(moved, 1), @stuck_ms) ->
        %{rest(mission, :search) | box: nil, search: %Search{}}

      late?(mission, goes_ms, @goes_ms) ->
        %{rest(mission, :search) | box: nil, search: %Search{}}

      stage == :push ->
        %{mission | phase: :push}

      true ->
        %{mission | phase: :approach}
    end
  end

  # Where it was last, and when it came there.
  defp moved({at, at_ms}, pose, now_ms) do
    if Pose.distance(at, pose) < @step, do: {at, at_ms}, else: {Pose.point(pose), now_ms}
  end

  defp moved(nil, pose, now_ms), do: {Pose.point(pose), now_ms}

  defp late?(_mission, nil, _most_ms), do: false
  defp late?(mission, since_ms, most_ms), do: mission.now_ms - since_ms > most_ms

  # One pushes alone.
  defp partner(%{side: 0}), do: :push

  defp partner(%{side: side} = mission) do
    Enum.find_value(fresh(mission), :none, fn {_id, peer} ->
      if peer.side == -side, do: peer.stage
    end)
  end

  @doc "How far its partner is from the box, edge to edge; far where none is heard."
  @spec partner_gap(Push.t(), map(), Robot.Percept.t()) :: float()
  def partner_gap(%{side: 0}, _scene, _percept), do: 0.0

  def partner_gap(%{side: side} = mission, scene, percept) do
    Enum.find_value(fresh(mission), 9.9, fn {id, peer} ->
      with true <- peer.side == -side, %{pose: pose, radius: radius} <- percept.peers[id] do
        {behind, _aside} = Plan.offset(scene, -side, pose, radius)
        behind
      else
        _no_partner -> nil
      end
    end)
  end

  @doc "The mission without a place, in this phase."
  @spec rest(Push.t(), atom()) :: Push.t()
  def rest(mission, phase),
    do: %{
      mission
      | phase: phase,
        side: nil,
        stage: :none,
        waits_ms: nil,
        goes_ms: nil,
        moved: nil
    }
end
