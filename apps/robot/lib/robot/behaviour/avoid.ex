defmodule Robot.Behaviour.Avoid do
  @moduledoc """
  Runs another behaviour, and bends or slows its wishes so that the robot touches nothing (R85).

  A wish with a velocity is bent: round standing robots and discs on the shortest way (`.Way`),
  past moving ones by `Robot.Navigation.Orca`, a little to the right of those who come, and away
  from what only the sonars see. A wish without one is only slowed down (`.Brake`). Who gets no
  nearer for some seconds goes another way for a while (`.Progress`), and who stands in another's
  way makes room (`.Yield`). Where a body that will not move stands in the goal, it stands as near
  as possible, and its wish says `by: :blocked`. A robot with nobody about gets its wish
  unchanged.

  Options: `inner`, the behaviour (required); `discs`, `[{x, y, radius}]` in the map frame, metres:
  further standing things.
  """
  @behaviour Robot.Behaviour
  alias Hal.{Options, Pose, Twist}
  alias Robot.{Behaviour, Percept, Wish}
  alias Robot.Navigation.{Orca, Steering}
  alias Robot.Behaviour.Avoid
  alias Robot.Behaviour.Avoid.{Brake, GiveWay, Neighbours, Progress}

  # Metres kept to others by reaction; to standing ones less when there is no more room.
  @standing_margin 0.12
  @moving_margin 0.15
  @closest 0.04
  # Metres from the nearest place to a taken goal that count as there.
  @beside 0.08
  # m/s of one who makes way.
  @aside 0.2
  # m/s away from what is close, at contact; and how close that is.
  @drift 0.25
  @close 0.16
  @horizon_s 2.5
  @standing_horizon_s 1.2
  @to_the_right :math.pi() / 12

  @impl Behaviour
  def new(options) do
    table = [
      inner: [{:check, &match?({_, _}, &1), "a behaviour"}, required: true],
      discs: [{:check, &Behaviour.discs?/1, "[{x, y, radius}]"}, default: []]
    ]

    state = %{
      progress: nil,
      way: nil,
      blocked?: false,
      standing: %{},
      backing?: false,
      velocity: nil,
      yield: nil
    }

    {__MODULE__, Enum.into(Options.check!(options, table, "avoid"), state)}
  end

  @impl Behaviour
  def update(options, state) do
    {discs, inner_options} = Keyword.pop(options, :discs, state.discs)
    {__MODULE__, %{state | discs: discs, inner: Behaviour.update(state.inner, inner_options)}}
  end

  @impl Behaviour
  def tick(percept, state) do
    case Behaviour.tick(state.inner, percept) do
      {:running, wish, inner} ->
        {wish, state} = safe(wish, percept, %{state | inner: inner})
        {:running, wish, {__MODULE__, state}}

      done ->
        done
    end
  end

  defp safe(nil, _percept, state), do: {nil, state}
  defp safe(wish, %Percept{pose: nil}, state), do: {wish, state}

  defp safe(%Wish{velocity: nil} = wish, percept, state) do
    robots = percept |> Neighbours.robots() |> Neighbours.near()
    {brake(wish, wish.twist, percept, robots), state}
  end

  defp safe(%Wish{velocity: {vx, vy}} = wish, percept, state) do
    speed = :math.sqrt(vx * vx + vy * vy)

    if speed < 0.02 or GiveWay.now?(state.yield, percept.at_ms),
      do: stay(wish, percept, %{state | progress: nil, velocity: nil, way: nil}),
      else: bend(wish, speed, percept, state)
  end

  # In its place it stands, unless somebody cannot get by.
  defp stay(wish, percept, state) do
    robots = percept |> Neighbours.robots() |> Neighbours.near()

    case GiveWay.note(state.yield, robots, percept.pose, percept.at_ms) do
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

        bend(wish, @aside, percept, %{state | yield: yield})
    end
  end

  defp bend(wish, speed, percept, state) do
    case Avoid.Route.taken(wish.goal, percept, Neighbours.robots(percept), state.discs) do
      nil -> bend_round(wish, speed, percept, state)
      near -> beside(wish, near, speed, percept, state)
    end
  end

  # Something stands where the goal is: as near as may be is the goal then.
  defp beside(wish, near, speed, percept, state) do
    distance = Pose.distance(percept.pose, near)
    leave = if state.blocked?, do: 2 * @beside, else: @beside

    if distance < leave do
      wish = %{wish | by: :blocked, twist: Twist.zero(), velocity: {0.0, 0.0}}
      {wish, %{state | blocked?: true, progress: nil, velocity: nil, way: nil}}
    else
      {x, y} = near
      speed = min(speed, Steering.approach(distance, percept.profile)) / distance
      velocity = {speed * (x - percept.pose.x), speed * (y - percept.pose.y)}
      twist = Steering.twist(velocity, percept.pose.heading, percept.profile)
      wish = %{wish | goal: near, velocity: velocity, twist: twist, reverse?: false}
      bend_round(wish, speed * distance, percept, %{state | blocked?: false})
    end
  end

  defp bend_round(wish, speed, percept, state) do
    {all, standing} = percept |> Neighbours.robots() |> Neighbours.steady(state.standing)
    robots = Neighbours.near(all)
    bodies = Enum.map(all, fn %{at: {x, y}, radius: radius} -> {x, y, radius} end)
    things = Neighbours.unknown(percept, bodies ++ state.discs)
    fixed = things ++ standing(state.discs, percept)
    way = wish.goal && Avoid.Route.round(state.way, wish.goal, percept, all, state.discs)
    corners = way && way.corners

    {aside, progress} =
      Progress.note(
        state.progress,
        way && Avoid.Route.left(way, Pose.point(percept.pose)),
        percept.robot,
        percept.at_ms
      )

    preferred =
      wish.velocity
      |> toward(corners, wish, speed, percept)
      |> keep_right(aside, corners, robots, percept)
      |> spread(robots ++ fixed, wish.goal, percept)

    planes = planes(percept, robots, fixed)

    velocity =
      planes
      |> Orca.solve(preferred, percept.profile.max_linear)
      |> calm(preferred, state.velocity)

    twist = twist(wish, velocity, preferred, percept, state.backing?)
    braked = brake(wish, twist, percept, robots)
    hindered? = braked.twist != twist or far?(velocity, preferred) or stopped?(percept)

    state = %{
      state
      | progress: Progress.hindered(progress, hindered?),
        standing: standing,
        way: way,
        velocity: velocity,
        backing?: if(twist.linear == 0.0, do: state.backing?, else: twist.linear < 0)
    }

    {braked, state}
  end

  defp toward(velocity, [_goal], _wish, _speed, _percept), do: velocity
  defp toward(velocity, nil, _wish, _speed, _percept), do: velocity

  # Round a corner the wished velocity points to the wrong side; its size remains.
  defp toward(_velocity, [{x, y} | _], _wish, speed, percept) do
    angle = :math.atan2(y - percept.pose.y, x - percept.pose.x)
    {speed * :math.cos(angle), speed * :math.sin(angle)}
  end

  defp keep_right(velocity, aside, _way, _robots, _percept) when aside != nil,
    do: turn(velocity, aside)

  defp keep_right(velocity, nil, way, robots, percept) do
    far? = way != nil and Pose.distance(percept.pose, hd(way)) > 1.0

    if far? and Enum.any?(robots, &coming?(&1, velocity, percept)),
      do: turn(velocity, -@to_the_right),
      else: velocity
  end

  # Somebody who moves, is ahead, and gets nearer.
  defp coming?(%{standing?: true}, _velocity, _percept), do: false

  defp coming?(%{at: {x, y}, velocity: {ox, oy}, gap: gap}, {vx, vy}, percept) do
    dx = x - percept.pose.x
    dy = y - percept.pose.y

    gap < 3.0 and dx * vx + dy * vy > 0 and dx * (vx - ox) + dy * (vy - oy) > 0 and
      ox * vx + oy * vy < 0
  end

  # Close along something it gets on only slowly, so it drifts off it, into the middle of a narrow
  # place; but not from what stands by its goal.
  defp spread(velocity, others, goal, percept) do
    Enum.reduce(others, velocity, fn %{at: {x, y}} = other, {vx, vy} = velocity ->
      if other.standing? and other.gap < @close and not by_goal?(other, goal, percept) do
        push = @drift * (1 - max(other.gap, 0.0) / @close)
        distance = max(Pose.distance(percept.pose, {x, y}), 0.01)
        {vx + push * (percept.pose.x - x) / distance, vy + push * (percept.pose.y - y) / distance}
      else
        velocity
      end
    end)
  end

  defp by_goal?(_other, nil, _percept), do: true

  defp by_goal?(%{at: at, radius: radius}, goal, percept) do
    Pose.distance(percept.pose, goal) < 0.8 and
      Pose.distance(at, goal) < percept.profile.radius + radius + 0.25
  end

  defp turn({vx, vy}, angle) do
    c = :math.cos(angle)
    s = :math.sin(angle)
    {c * vx - s * vy, s * vx + c * vy}
  end

  defp standing(discs, percept) do
    for {x, y, radius} <- discs do
      gap = Pose.distance(percept.pose, {x, y}) - radius - percept.profile.radius

      %{
        id: nil,
        at: {x, y},
        velocity: {0.0, 0.0},
        radius: radius,
        share: 1.0,
        standing?: true,
        gap: gap
      }
    end
  end

  defp planes(percept, robots, things) do
    at = Pose.point(percept.pose)
    own = own_velocity(percept)
    nearest = things |> Enum.filter(&(&1.gap < 1.5)) |> Enum.sort_by(& &1.gap) |> Enum.take(8)

    for %{gap: gap} = other <- nearest ++ robots do
      margin = if other.standing?, do: @standing_margin, else: @moving_margin
      horizon_s = if other.standing?, do: @standing_horizon_s, else: @horizon_s
      # The margin is a wish; only what is nearer than the tightest is pushed away from.
      margin = max(@closest, min(margin, gap - 0.01))
      radius = percept.profile.radius + other.radius + margin
      Orca.half_plane(at, own, other.at, other.velocity, radius, horizon_s, other.share)
    end
  end

  defp own_velocity(%{odometry: %{twist: twist}, pose: pose}),
    do: {twist.linear * :math.cos(pose.heading), twist.linear * :math.sin(pose.heading)}

  defp own_velocity(_percept), do: {0.0, 0.0}

  defp twist(wish, velocity, preferred, percept, backing?) do
    cond do
      near?(velocity, wish.velocity) ->
        wish.twist

      size(velocity) < 0.05 ->
        # No way now: look already where it will go on.
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
  # What is bent is smoothed: what others tell of themselves wobbles, and wheels turn slowly.
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
