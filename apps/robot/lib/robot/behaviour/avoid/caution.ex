defmodule Robot.Behaviour.Avoid.Caution do
  @moduledoc """
  Slows down a robot that cannot avoid the others by what they tell of their places, only by its own sonars. Pure.

  That is a robot that was started again on its way and has not found its place since; and one whose sonars see something
  that it cannot explain, but that may be another robot: because it is not sure of its own place among the others, or no
  longer hears one of them, which may have driven on since. Where unreported walls are, what has stood still for a
  while is not what it must beware of (`.Echoes`).
  """
  alias Hal.{Pose, Twist}
  alias Robot.{Percept, Wish}
  alias Robot.Behaviour.Avoid.{Echoes, Neighbours}
  alias Nav.Orca

  # Up to this speed (m/s) the gate's limits alone kept robots apart that all drove so across each other's ways without
  # looking (`Sim.GateAloneTest`; docs/reports/avoidance.md). A base may have few sonars behind.
  @speed 0.2
  @backwards 0.1
  # A robot whose place is not known better than this (metres, 95 of 100 cases) may meet others beside where they tell
  # that they are.
  @unsure 0.5
  # How far (metres) from where it tells a robot may be by its own mistake, and how fast (m/s) one that is silent may
  # have driven since.
  @astray 0.5
  @driven 0.5

  @doc """
  Whether it must slow down, and what it has seen; `robots` are the others (`Robot.Behaviour.Avoid.Neighbours.robots/1`), `discs` further bodies `{x, y, radius}` that explain echoes, in the map
  frame. `echoes` is what it returned at the last tick, `nil` where what stands still counts, too.

      iex> percept = %Robot.Percept{robot: :mag1, profile: Hal.Profile.magellan(), at_ms: 0, pose: Hal.Pose.new(0, 0)}
      iex> ahead = List.replace_at(List.duplicate(5.1, 16), 11, 1.0)
      iex> silent = %{mode: :dead, pose: Hal.Pose.new(4, 0), twist: Hal.Twist.zero(), radius: 0.2, at_ms: -5000}
      iex> alone = %{percept | sonar: ahead}
      iex> one_silent = %{alone | peers: %{mag2: silent}}
      iex> stands_there = put_in(one_silent.peers.mag2.pose, Hal.Pose.new(1.4, 0))
      iex> check = &Robot.Behaviour.Avoid.Caution.check(&1, Robot.Behaviour.Avoid.Neighbours.robots(&1), [], &2)
      iex> for percept <- [alone, one_silent, stands_there], do: check.(percept, nil)
      [{false, nil}, {true, nil}, {false, nil}]
      iex> {true, echoes} = check.(one_silent, %Robot.Behaviour.Avoid.Echoes{})
      iex> check.(%{one_silent | at_ms: 1_500}, echoes) |> elem(0)
      false
  """
  @spec check(Percept.t(), [Neighbours.t()], [{float(), float(), float()}], Echoes.t() | nil) ::
          {boolean(), Echoes.t() | nil}
  def check(%Percept{uncertainty: %{lost?: true}, peers: peers}, _robots, _discs, echoes)
      when peers != %{},
      do: {true, echoes}

  def check(%Percept{pose: nil}, _robots, _discs, echoes), do: {false, echoes}

  def check(%Percept{peers: peers, at_ms: at_ms} = percept, robots, discs, echoes) do
    own = astray(percept)

    doubtful =
      for peer <- Map.values(peers),
          peer.mode == :dead or own > @unsure,
          do: spot(peer, own, percept)

    if doubtful == [] do
      {false, echoes}
    else
      echoes = echoes && Echoes.note(echoes, percept)

      needed? =
        percept
        |> Neighbours.unknown(Neighbours.bodies(robots) ++ discs)
        |> Enum.any?(fn %{at: at} ->
          Enum.any?(doubtful, &within?(&1, at)) and
            not (echoes != nil and Echoes.stands?(echoes, at, at_ms))
        end)

      {needed?, echoes}
    end
  end

  defp astray(%Percept{uncertainty: %{radius: radius}}), do: radius
  defp astray(_percept), do: 0.0

  # Where it may be: a disc.
  defp spot(%{pose: pose, radius: radius, mode: mode, at_ms: at_ms}, own, percept) do
    driven = if mode == :dead, do: @driven * max(percept.at_ms - at_ms, 0) / 1000, else: 0.0
    {Pose.point(pose), radius + own + @astray + driven}
  end

  defp within?({place, reach}, at), do: Pose.distance(place, at) <= reach

  @doc "The percept, with the greatest speed that such a robot may have."
  @spec percept(Percept.t()) :: Percept.t()
  def percept(%Percept{profile: profile} = percept),
    do: %{percept | profile: %{profile | max_linear: min(profile.max_linear, @speed)}}

  @doc "The wish, at no more than that speed, and slower backwards; what another robot may do, its gate limits."
  @spec wish(Wish.t() | nil) :: Wish.t() | nil
  def wish(nil), do: nil

  def wish(%Wish{twist: twist, velocity: velocity} = wish) do
    linear = twist.linear |> min(@speed) |> max(-@backwards)

    %{
      wish
      | twist: Twist.new(linear, twist.turn),
        velocity: velocity && Orca.clip(velocity, @speed)
    }
  end
end
