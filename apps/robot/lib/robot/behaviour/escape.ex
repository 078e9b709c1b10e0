defmodule Robot.Behaviour.Escape do
  @moduledoc """
  Escapes after a bumper was touched: backs off 0.15 m, away from the touched side, and then
  turns away from it. It wishes nothing while nothing is touched, and never ends.

  A new touch makes it move, not a bumper that stays pressed: it escapes from each touch once. If
  the bumper is still pressed after backing off and the sonars see nothing near on that side, or
  after the turn, or after 4 s, that is a **fault** (`fault/1`): the switch may be stuck, or the
  robot may push a thing along. The robot stands until

    * the bumper is released, or
    * another bumper is touched, from which it escapes, or
    * the wheels are disarmed or the emergency stop is latched: a person is assumed to have seen
      what is pressed then. Those bumpers do not make the robot move when it is armed again, until
      they have been released once.

  Meanwhile the gate does not let the robot drive toward a pressed side (`Robot.Safety.Reflex`).

  Options: `distance` (metres, default 0.15), `turn` (radians, default 0.8).
  """
  @behaviour Robot.Behaviour
  alias Hal.{Options, Pose, Twist}
  alias Robot.Wish
  alias Nav.Steering

  # A robot that is blocked in front and behind gives up instead of pushing for ever.
  @give_up_ms 4000
  # An echo within this range (metres) and this angle (radians) of the touched side may come from
  # the thing that touches the robot.
  @near 0.4
  @aside 0.6
  # Limits that are taken for a person's action.
  @by_hand [:disarmed, :estop]

  @impl Robot.Behaviour
  def new(options \\ []) do
    table = [
      distance: [{:number, 0.01, 2.0, "m"}, default: 0.15],
      turn: [{:number, 0.0, 3.0, "rad"}, default: 0.8]
    ]

    state = %{phase: :idle, held: [], known: []}
    {__MODULE__, Enum.into(Options.check!(options, table, "escape"), state)}
  end

  @doc """
  Why the robot stands because of a fault, in one line; `nil` without a fault.

      iex> {Robot.Behaviour.Escape, state} = Robot.Behaviour.Escape.new()
      iex> Robot.Behaviour.Escape.fault(%{state | phase: :fault, held: [0, 3]})
      "bumpers 0 and 3 stay pressed"
  """
  @spec fault(state :: map()) :: String.t() | nil
  def fault(%{phase: :fault, held: [bumper]}), do: "bumper #{bumper} stays pressed"
  def fault(%{phase: :fault, held: held}), do: "bumpers #{Enum.join(held, " and ")} stay pressed"
  def fault(_state), do: nil

  @impl Robot.Behaviour
  def tick(percept, state) do
    pressed = percept.bumpers

    cond do
      by_hand?(percept) ->
        idle(%{state | held: [], known: pressed})

      # A base that is silent says nothing of its bumpers either: that is not a release, after
      # which the same bumper would be a new touch.
      percept.odometry == nil ->
        {:running, nil, {__MODULE__, state}}

      true ->
        # `held` are bumpers pressed ever since they were touched, `known` those pressed ever since
        # a person is assumed to have seen them.
        state = %{state | held: common(state.held, pressed), known: common(state.known, pressed)}
        act(percept, pressed -- (state.held ++ state.known), state)
    end
  end

  defp by_hand?(%{driving: %{limits: limits}}), do: Enum.any?(@by_hand, &(&1 in limits))
  defp by_hand?(_nothing_told), do: false

  defp common(some, pressed), do: Enum.filter(some, &(&1 in pressed))

  defp act(_percept, [], %{phase: :idle} = state), do: idle(state)
  defp act(_percept, [], %{phase: :fault, held: []} = state), do: idle(state)
  defp act(_percept, [], %{phase: :fault} = state), do: stand(state)

  defp act(percept, touched, %{phase: phase} = state) when phase in [:idle, :fault] do
    angle = contact_angle(touched, percept.profile.bumpers)
    known = state.known ++ state.held
    phase = {:back, angle, percept.odometry.pose, percept.at_ms}
    back(percept, %{state | phase: phase, held: touched, known: known})
  end

  defp act(percept, _more, state) do
    {_, _, _, since_ms} = state.phase

    cond do
      percept.at_ms - since_ms > @give_up_ms -> over(state)
      elem(state.phase, 0) == :back -> back(percept, state)
      true -> turn(percept, state)
    end
  end

  defp back(percept, %{phase: {:back, angle, from, since_ms}} = state) do
    cond do
      Pose.distance(percept.odometry.pose, from) < state.distance ->
        speed = if :math.cos(angle) >= 0, do: -0.15, else: 0.15
        running(Twist.new(speed, 0), state)

      state.held == [] or near?(percept, angle) ->
        # After a contact on the left it turns right; straight ahead counts as left.
        side = if angle >= 0, do: -1, else: 1
        goal = Pose.wrap(percept.odometry.pose.heading + side * state.turn)
        turn(percept, %{state | phase: {:turn, angle, goal, since_ms}})

      true ->
        over(state)
    end
  end

  defp turn(percept, %{phase: {:turn, _angle, goal, _since_ms}} = state) do
    error = Pose.wrap(goal - percept.odometry.pose.heading)

    if abs(error) < 0.1,
      do: over(state),
      else: running(Twist.new(0, Steering.turn_rate(error, percept.profile)), state)
  end

  defp over(%{held: []} = state), do: idle(state)
  defp over(state), do: stand(state)

  defp near?(%{sonar: nil}, _angle), do: false

  defp near?(%{profile: profile, sonar: ranges}, angle) do
    profile.sonars
    |> Enum.zip(ranges)
    |> Enum.any?(fn {sonar, range} ->
      range < @near and abs(Pose.wrap(sonar.heading - angle)) < @aside
    end)
  end

  defp idle(state), do: {:running, nil, {__MODULE__, %{state | phase: :idle}}}

  # No wish of a mission's goal has a greater weight.
  defp stand(state) do
    wish = Wish.new(:escape, Twist.zero(), 1.0)
    {:running, wish, {__MODULE__, %{state | phase: :fault}}}
  end

  defp running(twist, state), do: {:running, Wish.new(:escape, twist, 0.9), {__MODULE__, state}}

  # The mean direction of all touched segments, counter-clockwise from the front.
  defp contact_angle(bumpers, count) do
    angles = Enum.map(bumpers, &(&1 * 2 * :math.pi() / max(count, 1)))
    x = angles |> Enum.map(&:math.cos/1) |> Enum.sum()
    y = angles |> Enum.map(&:math.sin/1) |> Enum.sum()
    if abs(x) + abs(y) < 1.0e-6, do: 0.0, else: :math.atan2(y, x)
  end
end
