defmodule Robot.Behaviour.Avoid.Caution do
  @moduledoc """
  Slows a robot down that was started again on its way and has not found its place since: it cannot avoid the others by
  what they tell of theirs, only by its own sonars. Pure.
  """
  alias Hal.Twist
  alias Robot.{Percept, Wish}

  # Up to this speed (m/s) the gate's limits alone kept robots apart that all drove so across each other's ways without
  # looking (`Sim.GateAloneTest`; docs/results.md, section 6). A base may have few sonars behind.
  @speed 0.2
  @backwards 0.1

  @doc "The percept, with the greatest speed that such a robot may have among others."
  @spec percept(Percept.t()) :: Percept.t()
  def percept(%Percept{profile: profile} = percept) do
    if lost?(percept),
      do: %{percept | profile: %{profile | max_linear: min(profile.max_linear, @speed)}},
      else: percept
  end

  defp lost?(%Percept{uncertainty: %{lost?: true}, peers: peers}), do: peers != %{}
  defp lost?(_percept), do: false

  @doc "The wish, at no more than that speed, and slower backwards; what another robot may do, its gate limits."
  @spec wish(Wish.t() | nil, Percept.t()) :: Wish.t() | nil
  def wish(nil, _percept), do: nil

  def wish(%Wish{twist: twist, velocity: velocity} = wish, percept) do
    if lost?(percept) do
      linear = twist.linear |> min(@speed) |> max(-@backwards)
      %{wish | twist: Twist.new(linear, twist.turn), velocity: shorten(velocity, @speed)}
    else
      wish
    end
  end

  defp shorten(nil, _most), do: nil

  defp shorten({x, y} = velocity, most) do
    speed = :math.sqrt(x * x + y * y)
    if speed > most, do: {x * most / speed, y * most / speed}, else: velocity
  end
end
