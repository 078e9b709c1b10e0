defmodule Robot.Behaviour.Avoid do
  @moduledoc """
  Runs another behaviour, and changes or slows its wishes so that the robot avoids contact.

  The velocity of a wish is changed: the robot drives round standing robots and discs on a short
  route (`.Route`), past moving robots by `Nav.Orca` (`.Clearance`), a little to the
  right of oncoming ones, and away from bodies that are very close (`.Preference`). All wishes are
  slowed down near other robots (`.Brake`); one without a velocity is changed in no other way. A
  robot that makes no progress for some seconds leaves its route for a while (`.Progress`), and a
  robot that stands in another's way makes room (`.GiveWay`), and one that cannot turn backs out (`.BackOut`). If a body that will not move is in
  the goal, the robot goes to the nearest place beside it, stands there, and its wish has
  `by: :blocked`. If nothing is near, a wish within the profile's speed passes unchanged.

  Options: `inner`, the behaviour (required); `discs`, further standing obstacles,
  `[{x, y, radius}]` in the map frame, metres; `unmapped`, that the robot is where unreported walls are
  (`.Caution`).
  """
  @behaviour Robot.Behaviour
  alias Hal.{Options, Pose, Twist}
  alias Robot.{Percept, Wish}
  alias Nav.{Orca, Steering}
  alias Robot.Behaviour.Avoid

  alias Robot.Behaviour.Avoid.{
    BackOut,
    Brake,
    Caution,
    Clearance,
    Echoes,
    GiveWay,
    Neighbours,
    Preference,
    Progress,
    RightOfWay
  }

  # A robot this near (metres) to the place beside an occupied goal has arrived.
  @beside 0.08
  # An echo so near to a wall of the floor plan (metres) may be that wall's, seen in the wide cone of a sonar.
  @wall 0.3
  # The speed (m/s) of a robot that makes way, and of one that goes back to a passing place.
  @aside 0.2
  @back 0.4

  @impl Robot.Behaviour
  def new(options) do
    table = [
      inner: [{:check, &match?({_, _}, &1), "a behaviour"}, required: true],
      discs: [{:check, &Robot.Behaviour.discs?/1, "[{x, y, radius}]"}, default: []],
      unmapped: [:boolean, default: false]
    ]

    {unmapped?, options} = options |> Options.check!(table, "avoid") |> Keyword.pop!(:unmapped)

    state = %{
      progress: nil,
      way: nil,
      blocked?: false,
      standing: %{},
      backing?: false,
      velocity: nil,
      yield: nil,
      right: %RightOfWay{},
      out: %BackOut{},
      slow?: false,
      echoes: if(unmapped?, do: %Echoes{})
    }

    {__MODULE__, Enum.into(options, state)}
  end

  @impl Robot.Behaviour
  def update(options, state) do
    {discs, options} = Keyword.pop(options, :discs, state.discs)
    options = Keyword.delete(options, :unmapped)
    {__MODULE__, %{state | discs: discs, inner: Robot.Behaviour.update(state.inner, options)}}
  end

  @impl Robot.Behaviour
  def tick(percept, state) do
    all = Neighbours.robots(percept)
    {slow?, echoes} = Caution.check(percept, all, state.discs, state.echoes)
    state = %{state | slow?: slow?, echoes: echoes}

    if slow?,
      do: drive(Caution.percept(percept), all, state, &Caution.wish/1),
      else: drive(percept, all, state, & &1)
  end

  defp drive(percept, all, state, limit) do
    case Robot.Behaviour.tick(state.inner, percept) do
      {:running, wish, inner} ->
        # Before, because a velocity is bent as it is; and after, because the way round something may go backwards.
        {wish, state} = safe(limit.(wish), percept, all, %{state | inner: inner})
        {:running, limit.(wish), {__MODULE__, state}}

      done ->
        done
    end
  end

  defp safe(nil, _percept, _all, state), do: {nil, state}
  defp safe(wish, %Percept{pose: nil}, _all, state), do: {wish, state}

  defp safe(%Wish{velocity: nil} = wish, percept, all, state),
    do: {brake(wish, wish.twist, percept, Neighbours.near(all)), state}

  defp safe(wish, percept, all, state) do
    case BackOut.note(state.out, percept) do
      {nil, out} -> steer(wish, percept, all, %{state | out: out})
      {linear, out} -> back_out(wish, linear, percept, all, %{state | out: out})
    end
  end

  defp back_out(wish, linear, percept, all, state) do
    wish = %{wish | by: :back_out, goal: nil, reverse?: true, velocity: nil}

    {brake(wish, Twist.new(linear, 0), percept, Neighbours.near(all)),
     %{state | progress: nil, velocity: nil, way: nil}}
  end

  defp steer(%Wish{velocity: {vx, vy}} = wish, percept, all, state) do
    speed = :math.sqrt(vx * vx + vy * vy)

    if speed < 0.02 or GiveWay.now?(state.yield, percept.at_ms),
      do: stay(wish, percept, all, %{state | progress: nil, velocity: nil, way: nil}),
      else: bend(wish, speed, percept, all, state)
  end

  # A robot that wants to stand does so, unless another cannot get past it.
  defp stay(wish, percept, all, state) do
    case GiveWay.note(state.yield, Neighbours.near(all), percept.pose, percept.at_ms) do
      {nil, yield} ->
        {wish, %{state | yield: yield}}

      {{x, y}, yield} ->
        velocity = {@aside * x, @aside * y}
        twist = Steering.twist(velocity, percept.pose.heading, percept.profile, reverse_from: 1.6)

        wish = %{
          wish
          | by: :make_way,
            twist: twist,
            velocity: velocity,
            goal: nil,
            reverse?: true
        }

        bend(wish, @aside, percept, all, %{state | yield: yield})
    end
  end

  defp bend(wish, speed, percept, all, state) do
    case right_of_way(wish, percept, all, state) do
      {{:wait, place}, state} ->
        give_way(wish, place, min(speed, @back), percept, all, state)

      {:go, state} ->
        case Avoid.Route.taken(wish.goal, percept, all, state.discs) do
          nil -> bend_round(wish, speed, percept, all, state)
          near -> beside(wish, near, speed, percept, all, state)
        end
    end
  end

  defp right_of_way(%{goal: nil}, _percept, _all, state), do: {:go, state}

  defp right_of_way(_wish, percept, all, state) do
    corners = if state.way, do: state.way.corners, else: []
    {what, right} = RightOfWay.note(state.right, corners, percept, all)
    {what, %{state | right: right}}
  end

  # It goes to a place where another gets past, and stands there; its goal can wait.
  defp give_way(wish, place, speed, percept, all, state) do
    waiting = Robot.Behaviour.routed(state.inner, :waits, percept)
    near = if state.velocity == nil, do: 2 * @beside, else: @beside

    {wish, state} =
      if Pose.distance(percept.pose, place) < near do
        wish = %{wish | twist: Twist.zero(), velocity: {0.0, 0.0}}
        {wish, %{state | progress: nil, velocity: nil, way: nil}}
      else
        wish = %{toward(wish, place, speed, percept) | reverse?: true}
        bend_round(wish, speed, percept, all, state)
      end

    {%{wish | by: :give_way}, %{state | inner: waiting}}
  end

  # The goal is occupied, so the nearest place beside it becomes the goal.
  defp beside(wish, near, speed, percept, all, state) do
    distance = Pose.distance(percept.pose, near)
    leave = if state.blocked?, do: 2 * @beside, else: @beside

    if distance < leave do
      left = {:left, Pose.distance(percept.pose, wish.goal)}
      inner = Robot.Behaviour.routed(state.inner, left, percept)
      wish = %{wish | by: :blocked, twist: Twist.zero(), velocity: {0.0, 0.0}}
      {wish, %{state | inner: inner, blocked?: true, progress: nil, velocity: nil, way: nil}}
    else
      speed = min(speed, Steering.approach(distance, percept.profile))
      wish = %{toward(wish, near, speed, percept) | reverse?: false}
      bend_round(wish, speed, percept, all, %{state | blocked?: false})
    end
  end

  defp toward(wish, {x, y} = place, speed, percept) do
    share = speed / Pose.distance(percept.pose, place)
    velocity = {share * (x - percept.pose.x), share * (y - percept.pose.y)}
    twist = Steering.twist(velocity, percept.pose.heading, percept.profile)
    %{wish | goal: place, velocity: velocity, twist: twist}
  end

  defp bend_round(wish, speed, percept, all, state) do
    {all, standing} = Neighbours.steady(all, state.standing)
    robots = Neighbours.near(all)
    known = Neighbours.bodies(all) ++ state.discs

    things = percept |> Neighbours.unknown(known) |> doubt(percept, state.progress)

    fixed = things ++ Clearance.standing(state.discs, percept)
    way = wish.goal && Avoid.Route.round(state.way, wish.goal, percept, all, state.discs)
    corners = way && way.corners

    left =
      if way && not RightOfWay.near?(state.right, robots),
        do: Avoid.Route.left(way, Pose.point(percept.pose))

    {aside, progress} = Progress.note(state.progress, left, percept.robot, percept.at_ms)

    preferred =
      wish.velocity
      |> Preference.toward(corners, speed, percept)
      |> Preference.keep_right(aside, corners, robots, percept)
      |> Preference.spread(robots ++ fixed, wish.goal, percept)

    velocity =
      percept
      |> Clearance.planes(robots, fixed)
      |> Orca.solve(preferred, percept.profile.max_linear)
      |> calm(preferred, state.velocity)

    twist = twist(wish, velocity, preferred, percept, state.backing?)
    braked = brake(wish, twist, percept, robots)
    hindered? = braked.twist != twist or far?(velocity, preferred) or stopped?(percept)

    state = %{
      state
      | inner: tell(state.inner, way, percept),
        progress: Progress.hindered(progress, hindered?),
        standing: standing,
        way: way,
        velocity: velocity,
        backing?: if(twist.linear == 0.0, do: state.backing?, else: twist.linear < 0)
    }

    {braked, state}
  end

  # A robot that does not get on, as in a door whose posts its sonars see in its way, tries it by the floor plan; one that
  # does not get on by that either, because it is not where it believes to be, by its sonars again.
  defp doubt(things, percept, %Progress{tries: tries}) when rem(tries, 2) == 1,
    do: Neighbours.but_walls(things, percept, @wall)

  defp doubt(things, _percept, _progress), do: things

  defp tell(inner, nil, _percept), do: inner

  defp tell(inner, way, percept) do
    if Avoid.Route.none?(way, percept) do
      Robot.Behaviour.routed(inner, :no_way, percept)
    else
      left = Avoid.Route.left(way, Pose.point(percept.pose))
      Robot.Behaviour.routed(inner, {:left, left}, percept)
    end
  end

  defp twist(wish, velocity, preferred, percept, backing?) do
    cond do
      near?(velocity, wish.velocity) ->
        wish.twist

      size(velocity) < 0.05 ->
        # It cannot move now, so it turns toward where it will drive next.
        {px, py} = preferred
        error = Steering.turn_error(:math.atan2(py, px) - percept.pose.heading)
        Twist.new(0, Steering.turn_rate(error, percept.profile))

      true ->
        reverse? = wish.reverse? or size(velocity) < 0.15
        from = if backing?, do: 1.2, else: 2.0
        from = if reverse?, do: from, else: :infinity
        Steering.twist(velocity, percept.pose.heading, percept.profile, reverse_from: from)
    end
  end

  defp far?({ax, ay}, {bx, by}), do: abs(ax - bx) + abs(ay - by) > 0.05
  defp stopped?(%{driving: %{limits: limits}}), do: :near in limits or :bumper in limits
  defp stopped?(_percept), do: false

  # A changed velocity is smoothed, because the reported poses of others fluctuate and the wheels
  # react slowly.
  defp calm(velocity, _preferred, nil), do: velocity

  defp calm({vx, vy} = velocity, preferred, {lx, ly}) do
    if near?(velocity, preferred),
      do: velocity,
      else: {0.5 * vx + 0.5 * lx, 0.5 * vy + 0.5 * ly}
  end

  defp near?({ax, ay}, {bx, by}), do: abs(ax - bx) + abs(ay - by) < 1.0e-3
  defp size({x, y}), do: :math.sqrt(x * x + y * y)

  defp brake(wish, twist, percept, robots),
    do: %{wish | twist: Brake.twist(twist, percept.pose, percept.profile, robots)}
end
