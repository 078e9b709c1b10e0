defmodule Missions.Landmark.Shape.Squeeze do
  @moduledoc false
  # Decides for the leader how often its followers could not take the shape that they were given (`squeeze`), by what they
  # claim, and which places are barred; `Missions.Landmark.Shape` then chooses another. Pure.
  alias Hal.Pose
  alias Missions.Landmark
  alias Swarm.Formation
  alias Missions.Landmark.{Claim, Shape}

  # How long followers have to take what they were given, places of a cluster longer.
  @step_ms 3_000
  @cluster_ms 8_000
  # A leader that has moved so far (metres) begins anew.
  @elsewhere 1.0
  # So many blocked followers, if they are half of all, show that the shape does not fit.
  @many 3
  # A follower that is faster (m/s) drives on.
  @drives 0.05
  # How long a place is barred.
  @barred_ms 30_000
  # A follower that has not become sure for so long will not.
  @unsure_ms 15_000

  @doc "The shape with the steps of this tick, of `last` at most until only a cluster is left."
  @spec update(Shape.t(), Landmark.State.t(), last :: pos_integer()) :: Shape.t()
  def update(shape, mission, last),
    do:
      shape |> relax(mission) |> doubt(mission) |> squeeze(mission, last) |> lapse(mission.now_ms)

  defp relax(%{squeeze: 0, closest?: false} = shape, _mission), do: shape

  defp relax(shape, mission) do
    if Pose.distance(mission.percept.pose, shape.at) > @elsewhere,
      do: %{shape | squeeze: 0, closest?: false, squeezed_ms: mission.now_ms, barred: []},
      else: shape
  end

  # Since when all stand in their slots, and some are not sure of that.
  defp doubt(shape, mission) do
    claims = for {_index, claim} <- followers(mission), do: claim
    drives? = Enum.any?(mission.order, &drives?(mission.percept.peers[&1]))

    unsure? =
      not drives? and Enum.any?(claims, & &1.unsure) and
        Enum.all?(claims, &(&1.in_place or &1.unsure))

    %{shape | unsure_ms: if(unsure?, do: shape.unsure_ms || mission.now_ms)}
  end

  defp squeeze(shape, mission, last) do
    time_ms = if shape.rung == :cluster, do: @cluster_ms, else: @step_ms
    due? = mission.now_ms - (shape.squeezed_ms || mission.since_ms) >= time_ms
    steps = if due? and shape.rung != nil, do: steps(shape, mission, last), else: 0

    cond do
      steps > 0 -> stepped(bar(shape, mission), steps, mission)
      due? and unsure?(shape, mission) -> closest(shape, mission, last)
      true -> shape
    end
  end

  defp unsure?(%{rung: rung, closest?: closest?, unsure_ms: since_ms}, mission) do
    rung not in [nil, :cluster] and not closest? and since_ms != nil and
      mission.now_ms - since_ms >= @unsure_ms and closer?(mission.formation, mission.percept.grid)
  end

  # Whether the shape can be had with less spacing; the ladder has no ring with less.
  defp closer?({:circle, _spacing}, grid) when grid != nil, do: false
  defp closer?({_kind, spacing}, _grid), do: spacing > Formation.least_spacing() + 1.0e-6

  # Two steps before the last, the shape is the requested one with less spacing.
  defp closest(shape, mission, last),
    do: stepped(%{shape | closest?: true}, max(last - 2 - shape.squeeze, 0), mission)

  defp stepped(shape, steps, mission) do
    %{
      shape
      | squeeze: shape.squeeze + steps,
        squeezed_ms: mission.now_ms,
        unsure_ms: nil,
        at: Pose.point(mission.percept.pose)
    }
  end

  # A robot reports that it is blocked, and all others have come to rest in their places: as long
  # as some are under way, one of them may be the blocker. A robot that is not sure of its place
  # counts as at rest, too. If many are blocked, it is not each other that they are blocked by.
  defp steps(shape, mission, last) do
    followers = followers(mission)
    blocked = Enum.count(followers, fn {_index, claim} -> claim.blocked end)
    rest? = fn {_index, claim} -> claim.blocked or claim.in_place or claim.unsure end

    cond do
      blocked >= @many and 2 * blocked >= length(followers) ->
        max(last - shape.squeeze, 1)

      # In a cluster only blocked robots get another place.
      blocked > 0 and (shape.rung == :cluster or Enum.all?(followers, rest?)) ->
        1

      true ->
        0
    end
  end

  @doc """
  What the followers that are heard claim, each with its index in the order, from 0. One that drives on, as on a long way that it
  drives slowly because it is unsure of its place, is not kept from it yet.
  """
  @spec followers(Landmark.State.t()) :: [{non_neg_integer(), Claim.t()}]
  def followers(mission) do
    beats = Landmark.State.beats(mission)

    for {id, index} <- Enum.with_index(mission.order), beat = beats[id] do
      claim = Claim.of(beat)
      {index, %{claim | blocked: claim.blocked and not drives?(mission.percept.peers[id])}}
    end
  end

  defp drives?(%{twist: %{linear: linear}}), do: abs(linear) > @drives
  defp drives?(_unheard), do: false

  defp bar(%{rung: :cluster, spots: [_ | _] = spots} = shape, mission) do
    blocked =
      for {index, %{blocked: true}} <- followers(mission),
          spot = Enum.at(spots, index),
          do: {Pose.point(spot), mission.now_ms}

    %{shape | barred: blocked ++ shape.barred}
  end

  defp bar(shape, _mission), do: shape

  defp lapse(%{barred: barred} = shape, now),
    do: %{shape | barred: Enum.filter(barred, fn {_place, at_ms} -> now - at_ms < @barred_ms end)}
end
