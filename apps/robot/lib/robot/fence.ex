defmodule Robot.Fence do
  @moduledoc """
  Computes a fence that a robot must not cross: real robots that run together with simulated ones follow leaders that do
  not know the real walls. Pure.

  Corners are metres in the frame of the robot's own odometry, whose pose begins at the robot's
  start in the `map` frame and is moved only by odometry. Reports of other robots, and corrections
  by them, do not move the fence; slipping wheels do, so it should be laid at some distance from
  what must not be touched.

  By odometry, the whole body, as the circle round its corners, is kept 5 cm inside the fence. For
  a wished speed, the stopping path is computed, and the speed is lowered until that path stays
  inside. A body outside may turn, and may drive slowly where that does not take it farther out.
  """
  alias Hal.{Pose, Profile}

  @farthest 10_000
  @most 64
  @margin 0.05
  @outside_speed 0.2
  # Seconds: a step of the gate and the lag of the wheels, as in `Robot.Safety.Reflex.Body`.
  @reaction_s 0.15
  @step_s 0.1
  @halvings 6
  @rounding 1.0e-6

  @enforce_keys [:corners]
  defstruct @enforce_keys

  @type point :: {float(), float()}
  @type t :: %__MODULE__{corners: [point(), ...]}

  @doc """
  A fence: two opposite corners of a rectangle, `{{x, y}, {x, y}}`, or a list of 3 to 64 corners
  of a polygon, in order, whichever way round; its sides may not cross.

      iex> {:ok, fence} = Robot.Fence.new({{-1, -1}, {3, 2}})
      iex> fence.corners
      [{-1.0, -1.0}, {3.0, -1.0}, {3.0, 2.0}, {-1.0, 2.0}]
      iex> Robot.Fence.new([{0, 0}, {1, 1}])
      {:error, "a polygon of 3 to 64 corners, or two corners {{x, y}, {x, y}} of a rectangle"}
      iex> Robot.Fence.new([{0, 0}, {2, 2}, {2, 0}, {0, 2}])
      {:error, "a polygon whose sides do not cross each other"}
  """
  @spec new(term()) :: {:ok, t()} | {:error, allowed :: String.t()}
  def new({{x0, y0}, {x1, y1}}), do: new([{x0, y0}, {x1, y0}, {x1, y1}, {x0, y1}])

  def new([_, _, _ | _] = corners) when length(corners) <= @most do
    cond do
      not Enum.all?(corners, &place?/1) ->
        {:error, "corners {x, y} in metres, from -#{@farthest} to #{@farthest}"}

      crossed?(sides(corners)) ->
        {:error, "a polygon whose sides do not cross each other"}

      true ->
        {:ok, %__MODULE__{corners: for({x, y} <- corners, do: {x * 1.0, y * 1.0})}}
    end
  end

  def new(_other),
    do:
      {:error,
       "a polygon of 3 to #{@most} corners, or two corners {{x, y}, {x, y}} of a rectangle"}

  @doc "The type of a fence, for a table of `Hal.Options`: a fence, or an argument of `new/1`."
  @spec type() :: Hal.Options.Type.t()
  def type, do: {:check, &read/1, "a fence"}

  defp read(%__MODULE__{}), do: true

  defp read(corners) do
    with {:error, allowed} <- new(corners), do: Hal.Options.Wording.refuse(allowed, corners)
  end

  defp place?({x, y}),
    do: is_number(x) and is_number(y) and abs(x) <= @farthest and abs(y) <= @farthest

  defp place?(_other), do: false

  @doc """
  How far inside a place is (metres); negative outside.

      iex> {:ok, fence} = Robot.Fence.new({{-1, -1}, {3, 2}})
      iex> for place <- [{0, 0}, {2.9, 0.0}, {4, 0}], do: Float.round(Robot.Fence.clearance(fence, place), 3)
      [1.0, 0.1, -1.0]
  """
  @spec clearance(t(), {number(), number()}) :: float()
  def clearance(%__MODULE__{corners: corners}, place) do
    sides = sides(corners)
    distance = sides |> Enum.map(&distance(&1, place)) |> Enum.min()
    if inside?(sides, place), do: distance, else: -distance
  end

  @doc """
  The greatest speed (m/s) up to `linear`, in its direction, from which the body can stop inside.
  `turns` are the turn rates (rad/s) that it has and may have on the way; `age_s` is the age of
  the pose.

      iex> {:ok, fence} = Robot.Fence.new({{-1, -1}, {3, 2}})
      iex> profile = Hal.Profile.magellan()
      iex> Robot.Fence.free_speed(fence, profile, Hal.Pose.new(0, 0), 0.5, [0.0], 0.0)
      0.5
      iex> slow = Robot.Fence.free_speed(fence, profile, Hal.Pose.new(2.6, 0), 0.5, [0.0], 0.0)
      iex> slow > 0.2 and slow < 0.4
      true
      iex> Robot.Fence.free_speed(fence, profile, Hal.Pose.new(2.75, 0), 0.5, [0.0], 0.0)
      0.0
      iex> Robot.Fence.free_speed(fence, profile, Hal.Pose.new(2.75, 0), -0.5, [0.0], 0.0)
      0.5
      iex> Robot.Fence.free_speed(fence, profile, Hal.Pose.new(3.5, 0), -0.5, [0.0], 0.0)
      0.2
  """
  @spec free_speed(t(), Profile.t(), Pose.t(), float(), [float()], age_s :: float()) :: float()
  def free_speed(
        %__MODULE__{} = fence,
        %Profile{} = profile,
        %Pose{} = pose,
        linear,
        turns,
        age_s
      ) do
    need = profile.radius + @margin
    clear = clearance(fence, Pose.point(pose))
    most = if clear < need - @rounding, do: min(abs(linear), @outside_speed), else: abs(linear)
    reaction_s = @reaction_s + age_s
    sign = if linear < 0, do: -1.0, else: 1.0

    free? = fn speed ->
      Enum.all?(turns, fn turn ->
        stays?(fence, need, clear, pose, {sign * speed, turn}, reaction_s, profile)
      end)
    end

    cond do
      # Whatever its direction, it can stop inside.
      clear - need > most * reaction_s + most * most / (2 * profile.max_acceleration) -> most
      free?.(most) -> most
      true -> halve(free?, 0.0, most, @halvings)
    end
  end

  # Standing is always allowed.
  defp halve(_free?, low, _high, 0), do: low

  defp halve(free?, low, high, left) do
    middle = (low + high) / 2

    if free?.(middle),
      do: halve(free?, middle, high, left - 1),
      else: halve(free?, low, middle, left - 1)
  end

  # Whether, at each step of the stopping path, the clearance is either enough or not decreasing.
  defp stays?(fence, need, clear, pose, {linear, _turn} = twist, reaction_s, profile) do
    seconds = reaction_s + abs(linear) / profile.max_acceleration
    steps = ceil(seconds / @step_s)

    Enum.reduce_while(1..steps//1, {pose, clear}, fn k, {pose, before} ->
      middle_s = (k - 0.5) * @step_s
      pose = move(pose, twist, speed(linear, middle_s - reaction_s, profile.max_acceleration))
      now = clearance(fence, Pose.point(pose))
      if now >= min(before, need) - @rounding, do: {:cont, {pose, now}}, else: {:halt, :over}
    end) != :over
  end

  defp speed(linear, braked_s, _braking) when braked_s <= 0, do: linear
  defp speed(linear, braked_s, braking) when linear < 0, do: min(linear + braked_s * braking, 0.0)
  defp speed(linear, braked_s, braking), do: max(linear - braked_s * braking, 0.0)

  defp move(pose, {_linear, turn}, speed) do
    heading = pose.heading + turn * @step_s / 2
    x = pose.x + speed * @step_s * :math.cos(heading)
    y = pose.y + speed * @step_s * :math.sin(heading)
    %{pose | x: x, y: y, heading: pose.heading + turn * @step_s}
  end

  defp sides([first | rest] = corners), do: Enum.zip(corners, rest ++ [first])

  defp distance({{ax, ay}, {bx, by}}, {x, y}) do
    dx = bx - ax
    dy = by - ay
    along = dx * dx + dy * dy
    share = if along > 0, do: ((x - ax) * dx + (y - ay) * dy) / along, else: 0.0
    share = share |> max(0.0) |> min(1.0)
    ex = x - ax - share * dx
    ey = y - ay - share * dy
    :math.sqrt(ex * ex + ey * ey)
  end

  # A place is inside if a ray to the right crosses the sides an odd number of times.
  defp inside?(sides, {x, y}) do
    Enum.count(sides, fn {{ax, ay}, {bx, by}} ->
      ay > y != by > y and x < ax + (y - ay) * (bx - ax) / (by - ay)
    end)
    |> rem(2) == 1
  end

  # Neighbouring sides share a corner, but must not overlap.
  defp crossed?(sides) do
    numbered = Enum.with_index(sides)
    last = length(sides) - 1
    pairs = for {p, i} <- numbered, {q, j} <- numbered, i < j, do: {p, q, i, j}

    Enum.any?(sides, fn {a, b} -> a == b end) or
      Enum.any?(pairs, fn
        {p, q, i, j} when j == i + 1 -> folded?(p, q)
        {p, q, 0, ^last} -> folded?(q, p)
        {p, q, _i, _j} -> meet?(p, q)
      end)
  end

  defp folded?({a, b}, {b, c}), do: cross(a, b, c) == 0 and dot(b, a, c) > 0

  defp meet?({a, b}, {c, d}) do
    [ac, ad] = [cross(a, b, c), cross(a, b, d)]
    [ca, cb] = [cross(c, d, a), cross(c, d, b)]

    (ac * ad < 0 and ca * cb < 0) or on?(a, b, c, ac) or on?(a, b, d, ad) or on?(c, d, a, ca) or
      on?(c, d, b, cb)
  end

  defp on?(a, b, point, cross), do: cross == 0 and dot(point, a, b) <= 0

  defp cross({ax, ay}, {bx, by}, {cx, cy}), do: (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
  defp dot({ax, ay}, {bx, by}, {cx, cy}), do: (bx - ax) * (cx - ax) + (by - ay) * (cy - ay)
end
