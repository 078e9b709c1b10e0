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

  @doc "The percept of a robot that shall go no faster than what it knows allows."
  @spec percept(Percept.t()) :: Percept.t()
  def percept(%Percept{uncertainty: %{lost?: true}, peers: peers, profile: profile} = percept)
      when peers != %{},
      do: %{percept | profile: %{profile | max_linear: min(profile.max_linear, @speed)}}

  def percept(percept), do: percept

  @doc "The wish at no more than the speed of the percept's profile."
  @spec wish(Wish.t(), Percept.t()) :: Wish.t()
  def wish(%Wish{twist: twist, velocity: velocity} = wish, %Percept{profile: %{max_linear: most}}) do
    %{
      wish
      | twist: Twist.new(twist.linear |> min(most) |> max(-@backwards), twist.turn),
        velocity: shorten(velocity, most)
    }
  end

  defp shorten(nil, _most), do: nil

  defp shorten({x, y} = velocity, most) do
    speed = :math.sqrt(x * x + y * y)
    if speed > most, do: {x * most / speed, y * most / speed}, else: velocity
  end
end
