defmodule Missions.Push.Box do
  @moduledoc """
  Describes a box on the floor by its pose, as robots think of it: its corners, how a camera sees it, how a robot pushes it. Pure;
  metres and radians. Its length is along its heading; turned by half a circle it is the same.

  A robot that would be in it has pushed it: along the normal `n` of the side, where `r` leads from its middle to the contact, it moves along `n`
  and turns in the ratio 1 to `(r x n) / c^2` (Lynch and Mason, "Stable pushing: mechanics, controllability, and planning", Int. J. Robotics Research
  15(6), 1996, the ellipsoid limit surface), with `c` 0.52 of half its diagonal.
  """
  alias Hal.Pose

  @turn_ratio 0.52

  @type size :: {length :: float(), width :: float()}

  @doc "Its corners."
  @spec corners(Pose.t(), size()) :: [Pose.point(), ...]
  def corners(pose, {length, width}) do
    for {a, b} <- [{1, 1}, {-1, 1}, {-1, -1}, {1, -1}],
        do: Pose.place(pose, {a * length / 2, b * width / 2})
  end

  @doc "Discs that cover it, for ways round it."
  @spec discs(Pose.t(), size(), clear :: float()) :: [{float(), float(), float()}]
  def discs(pose, {length, width}, clear) do
    count = max(ceil(2 * length / width), 1)

    for k <- 0..count do
      {x, y} = Pose.place(pose, {(k / count - 0.5) * (length - width), 0.0})
      {x, y, width / 2 + clear}
    end
  end

  @doc """
  How far a disc is from it, negative where it is in it, the direction from the box to the disc, and where they meet.

      iex> {gap, {nx, ny}, _at} = Missions.Push.Box.gap(Hal.Pose.new(0, 0), {1.2, 0.4}, {0.3, -0.5, 0.2})
      iex> {Float.round(gap, 6), Float.round(nx, 6), Float.round(ny, 6)}
      {0.1, 0.0, -1.0}
  """
  @spec gap(Pose.t(), size(), {float(), float(), float()}) ::
          {float(), {float(), float()}, Pose.point()}
  def gap(pose, {length, width}, {dx, dy, r}) do
    %{x: x, y: y} = Pose.relative(pose, Pose.new(dx, dy))
    {hx, hy} = {length / 2, width / 2}
    {nx, ny} = {x |> max(-hx) |> min(hx), y |> max(-hy) |> min(hy)}
    far = Pose.distance({x, y}, {nx, ny})
    side = if y < 0.0, do: -1.0, else: 1.0

    # Robots stand at the long sides: the middle of a disc in the box has come through the nearer one.
    {gap, {ux, uy}, at} =
      if far > 0.0,
        do: {far - r, {(x - nx) / far, (y - ny) / far}, {nx, ny}},
        else: {abs(y) - hy - r, {0.0, side}, {x, side * hy}}

    {c, s} = {:math.cos(pose.heading), :math.sin(pose.heading)}
    {gap, {ux * c - uy * s, ux * s + uy * c}, Pose.place(pose, at)}
  end

  @doc "The box after a robot came to this disc, and how far it was pushed there."
  @spec pushed(Pose.t(), size(), {float(), float(), float()}) :: {Pose.t(), way :: float()}
  def pushed(pose, {length, width} = size, disc) do
    case gap(pose, size, disc) do
      {gap, {ux, uy}, {px, py}} when gap < 0.0 ->
        c = @turn_ratio * :math.sqrt(length * length + width * width) / 2
        {nx, ny} = {-ux, -uy}
        lever = (px - pose.x) * ny - (py - pose.y) * nx
        way = -gap / (1 + lever * lever / (c * c))
        turned = pose.heading + way * lever / (c * c)
        {Pose.new(pose.x + way * nx, pose.y + way * ny, turned), -gap}

      _apart ->
        {pose, 0.0}
    end
  end

  @doc """
  What a camera at a place sees of it: the corners at its left and right edge, and the nearest one, along the axis `axis` of the camera.

      iex> {left, right, near} = Missions.Push.Box.edges(Hal.Pose.new(2, 0, :math.pi() / 2), {1.2, 0.4}, {0.0, 0.0}, 0.0)
      iex> for {x, y} <- [left, right], do: {Float.round(x, 3), Float.round(y, 3)}
      [{1.8, 0.6}, {1.8, -0.6}]
      iex> Float.round(elem(near, 0), 3)
      1.8
  """
  @spec edges(Pose.t(), size(), Pose.point(), axis :: float()) ::
          {left :: Pose.point(), right :: Pose.point(), near :: Pose.point()}
  def edges(pose, size, {x, y}, axis) do
    corners = corners(pose, size)
    middle = :math.atan2(pose.y - y, pose.x - x)
    aside = fn {cx, cy} -> Pose.wrap(:math.atan2(cy - y, cx - x) - middle) end

    near =
      Enum.min_by(corners, fn {cx, cy} ->
        (cx - x) * :math.cos(axis) + (cy - y) * :math.sin(axis)
      end)

    {Enum.max_by(corners, aside), Enum.min_by(corners, aside), near}
  end
end
