defmodule Sim.World.Pushing do
  @moduledoc """
  Moves balls and boxes (`Sim.World.Object`): by robots that push them, and balls that roll. Pure.

  A ball that is hit leaves with the robot's speed along the line between the two, and a fifth more. It rolls on, 0.2 m/s slower each
  second, and bounces from what is solid with half of its speed.

  A box slides only while it is pushed, by the ellipsoid limit surface of quasi-static sliding (Lynch and Mason, Int. J. Robotics
  Research 15(6), 1996): pushed along `n` at `r` from its middle without friction, it moves along `n` and turns in
  the ratio 1 to `(r x n) / c^2`, where `c` is its greatest moment of friction over its greatest force, 0.52 of half its diagonal. So a push
  towards its middle moves it straight, and one at its end turns it.

  What cannot make way, because there is a wall, the landmark, another box or a robot behind it, stops the robot.
  """
  alias Hal.Pose
  alias Sim.{Floorplan, World}
  alias Sim.World.{Bodies, Contact, Object}

  # Of the speeds along the line between two: what is left of them after they met.
  @kick 0.2
  @bounce 0.5
  @friction 0.2
  @still 0.005
  @clear 1.0e-6
  @rounds 40
  @turn_ratio 0.52
  # Beside the line between robot and ball: so far a ball slips round the robot in one step, in radians.
  @slips [0, 1, -1, 2, -2, 4, -4, 8, -8, 12, -12] |> Enum.map(&(&1 * :math.pi() / 90))

  @typedoc "What stands where it is: walls, and discs."
  @type solid :: {Floorplan.t(), [Contact.disc()]}

  @doc "The objects after a robot's body moved to this disc in `dt_ms`, or `:stuck`, where one cannot make way."
  @spec give([Object.t()], Contact.disc(), was :: Pose.point(), solid(), pos_integer()) ::
          {:ok, [Object.t()]} | :stuck
  def give([], _disc, _was, _solid, _dt_ms), do: {:ok, []}

  def give(objects, {x, y, _r} = disc, {wx, wy}, solid, dt_ms) do
    speed = {(x - wx) * 1000 / dt_ms, (y - wy) * 1000 / dt_ms}
    {boxes, balls} = Enum.split_with(objects, &(&1.kind == :box))

    with {:ok, boxes} <- all(boxes, &slide(&1, disc, solid, others(boxes, &1))),
         {:ok, balls} <- all(balls, &kick(&1, disc, speed, solid, others(balls, &1) ++ boxes)) do
      moved = Map.new(boxes ++ balls, &{&1.id, &1})
      {:ok, Enum.map(objects, &moved[&1.id])}
    end
  end

  defp all(objects, move) do
    Enum.reduce_while(objects, {:ok, []}, fn object, {:ok, done} ->
      case move.(object) do
        :stuck -> {:halt, :stuck}
        moved -> {:cont, {:ok, [moved | done]}}
      end
    end)
  end

  defp others(objects, %{id: id}), do: Enum.reject(objects, &(&1.id == id))

  # A box must make way for the disc and may not go into another one: it is pushed out of one after the other.
  defp slide(box, disc, {map, discs}, boxes) do
    if overlap(box, disc) == nil,
      do: box,
      else: Enum.find_value([true, false], :stuck, &slid(box, [disc | discs], map, boxes, &1))
  end

  defp slid(box, discs, map, boxes, turns?) do
    near = Enum.filter(discs, fn disc -> elem(Object.gap(box, disc), 0) < 0.5 end)
    moved = yield(box, near, turns?, @rounds)

    if moved != nil and Object.free?(moved, map) and not Enum.any?(boxes, &crossed?(moved, &1)),
      do: moved
  end

  defp yield(_box, _discs, _turns?, 0), do: nil

  defp yield(box, discs, turns?, rounds) do
    case Enum.flat_map(discs, &List.wrap(overlap(box, &1))) do
      [] ->
        box

      overlaps ->
        box
        |> pushed(Enum.max_by(overlaps, &elem(&1, 0)), turns?)
        |> yield(discs, turns?, rounds - 1)
    end
  end

  defp overlap(box, disc) do
    {gap, direction, nearest} = Object.gap(box, disc)
    if gap < -@clear, do: {-gap, direction, nearest}
  end

  defp pushed(%{pose: pose, size: {length, width}} = box, {depth, {nx, ny}, {px, py}}, turns?) do
    c = @turn_ratio * :math.sqrt(length * length + width * width) / 2
    lever = if turns?, do: (px - pose.x) * ny - (py - pose.y) * nx, else: 0.0
    way = (depth + @clear) / (1 + lever * lever / (c * c))
    turn = way * lever / (c * c)
    %{box | pose: Pose.new(pose.x + way * nx, pose.y + way * ny, pose.heading + turn)}
  end

  # Two boxes cross where one has a corner or a part of its middle line in the other.
  defp crossed?(a, b), do: touches?(a, b) or touches?(b, a)

  defp touches?(a, b) do
    points = for({x, y, _r} <- Object.discs(a), do: {x, y}) ++ Object.corners(a)
    Enum.any?(points, fn {x, y} -> elem(Object.gap(b, {x, y, 0.0}), 0) < 0.0 end)
  end

  # The ball leaves the robot along the line between the two, or slips aside.
  defp kick(%{pose: pose, size: r} = ball, {x, y, robot_r} = disc, speed, {map, discs}, objects) do
    {gap, {nx, ny}, _nearest} = Object.gap(ball, disc)

    if gap >= -@clear do
      out_of_boxes(ball, objects, {map, discs})
    else
      far = robot_r + r + @clear

      placed =
        Enum.find_value(@slips, fn slip ->
          {c, s} = Sim.Trig.cos_sin(slip)
          place = {x + far * (nx * c - ny * s), y + far * (nx * s + ny * c)}
          if free?(place, r, {map, discs}, objects), do: place
        end)

      case placed do
        nil ->
          :stuck

        {px, py} ->
          %{
            ball
            | pose: Pose.new(px, py, pose.heading),
              velocity: met(ball.velocity, speed, {nx, ny}, @kick)
          }
      end
    end
  end

  # A box that moved may have come over a ball.
  defp out_of_boxes(%{pose: pose, size: r} = ball, objects, solid) do
    case for(
           %{kind: :box} = box <- objects,
           {gap, direction, _} <- [Object.gap(box, disc(ball))],
           gap < -@clear,
           do: {gap, direction}
         ) do
      [] ->
        ball

      [{gap, {nx, ny}} | _more] ->
        place = {pose.x + (gap - @clear) * nx, pose.y + (gap - @clear) * ny}
        {px, py} = place

        if free?(place, r, solid, []),
          do: %{ball | pose: Pose.new(px, py, pose.heading)},
          else: :stuck
    end
  end

  defp free?({x, y} = place, r, {map, discs}, objects) do
    Floorplan.free?(map, place, r) and Enum.all?(discs, &(Contact.gap(&1, {x, y, r}) >= 0.0)) and
      Enum.all?(objects, &(elem(Object.gap(&1, {x, y, r}), 0) >= 0.0))
  end

  # The velocity of a ball after it met what moves with `speed`, with `n` from that to the ball; `share` of the speeds
  # is given back.
  defp met({vx, vy}, {sx, sy}, {nx, ny}, share) do
    closing = (sx - vx) * nx + (sy - vy) * ny
    more = max(closing, 0.0) * (1 + share)
    {vx + more * nx, vy + more * ny}
  end

  @doc "The world where an object was put, by a person, at rest; the error is one line."
  @spec place(World.t(), String.t(), Pose.t()) :: {:ok, World.t()} | {:error, String.t()}
  def place(%{objects: objects} = world, id, %Pose{} = pose) do
    case Enum.split_with(objects, &(&1.id == id)) do
      {[object], others} ->
        placed = %{object | pose: pose, velocity: {0.0, 0.0}}
        moved = Enum.map(objects, &if(&1.id == id, do: placed, else: &1))

        if Bodies.room?(world, placed, others),
          do: {:ok, %{world | objects: moved}},
          else: {:error, "#{id} cannot be put at #{pose.x},#{pose.y}: there is no room"}

      {[], _all} ->
        {:error, "there is no #{id}"}
    end
  end

  @doc "The balls roll for `dt_ms`."
  @spec roll(World.t(), pos_integer()) :: World.t()
  def roll(%{objects: []} = world, _dt_ms), do: world

  def roll(world, dt_ms) do
    objects =
      Enum.reduce(world.objects, world.objects, fn object, objects ->
        others = others(objects, object)
        rolled = rolled(object, others, world, dt_ms / 1000)
        Enum.map(objects, &if(&1.id == object.id, do: rolled, else: &1))
      end)

    %{world | objects: objects}
  end

  defp rolled(%{velocity: {vx, vy}} = object, _others, _world, _s) when vx == 0.0 and vy == 0.0,
    do: object

  defp rolled(%{pose: pose, velocity: {vx, vy}} = ball, others, world, s) do
    solid = solids(world) ++ near_points(others, disc(ball))
    {{x, y}, share} = Contact.move(world.map, disc(ball), {vx * s, vy * s}, solid)
    ball = %{ball | pose: Pose.new(x, y, pose.heading)}
    {vx, vy} = if share < 1.0, do: bounced(ball, world.map, solid), else: ball.velocity
    speed = :math.sqrt(vx * vx + vy * vy)
    left = if speed > @still, do: max(speed - @friction * s, 0.0) / speed, else: 0.0
    %{ball | velocity: {vx * left, vy * left}}
  end

  defp bounced(%{velocity: velocity} = ball, map, discs) do
    {x, y, r} = at = disc(ball)
    {walls, _near?} = Contact.walls(map, at)

    met =
      for({dx, dy, dr} <- discs, Contact.gap(at, {dx, dy, dr}) <= 0.001, do: {dx, dy}) ++ walls

    Enum.reduce(met, velocity, fn {px, py}, velocity ->
      far = max(Pose.distance({x, y}, {px, py}), r * 1.0e-3)
      met(velocity, {0.0, 0.0}, {(x - px) / far, (y - py) / far}, @bounce)
    end)
  end

  # Other objects as discs, as a ball meets them.
  defp near_points(objects, at) do
    for object <- objects, {_gap, _direction, {x, y}} = Object.gap(object, at), reduce: [] do
      discs ->
        if object.kind == :ball, do: Object.discs(object) ++ discs, else: [{x, y, 0.0} | discs]
    end
  end

  defp disc(ball), do: hd(Object.discs(ball))
  defp solids(world), do: Bodies.pole(world) ++ Enum.map(Bodies.all(world), &Bodies.disc/1)
end
