defmodule Robot.Behaviour.Wander do
  @moduledoc """
  Wanders without a goal, and turns away from what the sonars see ahead. In open space its turn
  rate follows from the robot's name and the time, so that runs are repeatable. Never ends.

  Options: `speed` (m/s, default 0.3).
  """
  @behaviour Robot.Behaviour
  alias Hal.{Options, Twist}
  alias Robot.Wish
  alias Robot.Safety.Reflex

  # The distance (metres) at which something ahead makes it turn, and the time between changes of
  # direction in open space.
  @near 0.7
  @leg_ms 6000

  @impl Robot.Behaviour
  def new(options \\ []) do
    table = [speed: [{:number, 0.0, 10.0, "m/s"}, default: 0.3]]
    {__MODULE__, Enum.into(Options.check!(options, table, "wander"), %{side: nil})}
  end

  @impl Robot.Behaviour
  def tick(percept, state) do
    half = percept.profile.radius + 0.1
    points = Reflex.Body.points(percept.profile, percept.sonar || [])

    case for({x, y} <- points, x > 0, x < half + @near, abs(y) < half + 0.1, do: {x, y}) do
      [] ->
        leg = :erlang.phash2({percept.robot, div(percept.at_ms, @leg_ms)}, 100)
        running(Twist.new(state.speed, (leg - 50) / 250), %{state | side: nil})

      near ->
        # It keeps turning to the side that it chose first, or it would oscillate in a corner.
        {_, y} = Enum.min_by(near, fn {x, y} -> x * x + y * y end)
        side = state.side || if(y > 0, do: -1, else: 1)
        running(Twist.new(0, side * 0.6 * percept.profile.max_turn), %{state | side: side})
    end
  end

  defp running(twist, state), do: {:running, Wish.new(:wander, twist, 0.3), {__MODULE__, state}}
end
