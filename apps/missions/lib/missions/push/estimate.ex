defmodule Missions.Push.Estimate do
  @moduledoc """
  Estimates where a box of known size lies, by the edges of its blob in the pictures of several robots, and by the robots that push it. Pure;
  metres and radians in the map frame, milliseconds.

  A sum of Gaussians (Alspach and Sorenson, "Nonlinear Bayesian estimation using Gaussian sum approximations", IEEE Trans. Automatic Control
  17(4), 1972): it begins with twelve headings in a half circle. Each is an extended Kalman filter of the pose, corrected by three numbers of a sighting:
  the bearings of the left and the right edge, and how far ahead the nearest corner is by the lowest row of the blob (`Robot.Percept.Ground`). One that
  is less likely than the best by e^6, or has come to the same pose as a better one, is dropped. The box is found when one is left.

  Robots cannot be in the box: one that would be has pushed it (`Missions.Push.Box.pushed/3`), and what it is pushed makes its pose less certain.
  """
  alias Hal.Pose
  alias Missions.Push.Box

  @headings 12
  @start_var 0.25
  @start_heading_var 0.07
  @adopted_var 0.02
  # Log-likelihoods behind the best; poses (m, rad) that are one.
  @behind 6.0
  @same 0.12
  @same_heading 0.2
  # Of a measurement in deviations: beyond it nothing is learnt. So many sightings in a row beyond it are another box.
  @gate 3.5
  @elsewhere 10
  # What a push adds a metre; standing errors of the robots' poses leave so much.
  @way_var 0.005
  @way_heading_var 0.015
  @floor 4.0e-4
  @found 5
  @sure 0.15
  @sure_heading 0.2
  # What an edge is uncertain by (rad).
  @edge_sd 0.008

  @enforce_keys [:size, :all, :seen_ms]
  defstruct @enforce_keys ++ [seen: 0, outside: 0, pushed_ms: nil, sd: 0.0]

  @typedoc """
  A pose, its covariance by rows (x, y, heading), and its log-likelihood. `sd` of an estimate is how uncertain the robots that saw it last are of their
  own places, on average: no number of sightings makes the box more certain than that.
  """
  @type guess :: %{pose: Pose.t(), var: [[float()]], likely: float()}
  @type t :: %__MODULE__{
          size: Box.size(),
          all: [guess(), ...],
          seen_ms: integer(),
          seen: non_neg_integer(),
          outside: non_neg_integer(),
          pushed_ms: integer() | nil,
          sd: float()
        }

  @typedoc """
  What a robot at `at` saw, whose camera looked along `axis`: the bearings of the edges in the map frame, `near` metres ahead along the axis, each `nil`
  if it was not in the picture; the deviations of its place and heading.
  """
  @type sighting :: %{
          at: Pose.point(),
          axis: float(),
          left: float() | nil,
          right: float() | nil,
          near: float() | nil,
          sd: float(),
          sd_heading: float()
        }

  @doc "The estimate after a sighting at this time; it begins with one that shows both edges and the foot."
  @spec note(t() | nil, sighting(), Box.size(), integer()) :: t() | nil
  def note(nil, %{left: nil}, _size, _at_ms), do: nil
  def note(nil, %{right: nil}, _size, _at_ms), do: nil
  def note(nil, %{near: nil}, _size, _at_ms), do: nil

  def note(nil, sighting, size, at_ms) do
    guesses =
      for k <- 0..(@headings - 1),
          do: guess(sighting, size, k * :math.pi() / @headings - :math.pi() / 2)

    %__MODULE__{size: size, all: guesses, seen_ms: at_ms, sd: sighting.sd}
  end

  def note(%__MODULE__{size: size} = estimate, sighting, _size, at_ms) do
    corrected = Enum.map(estimate.all, &correct(&1, sighting, size))
    inside = for {guess, true} <- corrected, do: guess

    cond do
      inside != [] ->
        all =
          for {guess, inside?} <- corrected,
              do: %{guess | likely: guess.likely - if(inside?, do: 0.0, else: 3.0)}

        %{
          estimate
          | all: keep(all),
            seen_ms: at_ms,
            seen: min(estimate.seen + 1, 1_000),
            sd: estimate.sd + 0.1 * (sighting.sd - estimate.sd),
            outside: 0
        }

      estimate.outside + 1 >= @elsewhere ->
        note(nil, sighting, size, at_ms) || estimate

      true ->
        %{estimate | outside: estimate.outside + 1}
    end
  end

  @doc """
  What another robot is sure of, for one that knows nothing of the box: it may have been pushed until now, and how uncertain that robot is of its
  own place is `sd`.
  """
  @spec adopt(Pose.t(), sd :: float(), Box.size(), integer()) :: t()
  def adopt(pose, sd, size, at_ms) do
    var = [[@adopted_var, 0.0, 0.0], [0.0, @adopted_var, 0.0], [0.0, 0.0, @adopted_var]]
    guess = %{pose: pose, var: var, likely: 0.0}
    %__MODULE__{size: size, all: [guess], seen_ms: at_ms, pushed_ms: at_ms, seen: @found, sd: sd}
  end

  # At the middle between the edges, behind the nearest corner.
  defp guess(%{at: {x, y}, axis: axis} = sighting, {length, width}, heading) do
    middle = sighting.right + Pose.wrap(sighting.left - sighting.right) / 2
    # Half of how deep a box with this heading is, along the line of sight.
    aside = heading - middle
    deep = (length * abs(:math.cos(aside)) + width * abs(:math.sin(aside))) / 2
    far = sighting.near / max(:math.cos(Pose.wrap(middle - axis)), 0.3) + deep
    pose = Pose.new(x + far * :math.cos(middle), y + far * :math.sin(middle), heading)
    var = [[@start_var, 0.0, 0.0], [0.0, @start_var, 0.0], [0.0, 0.0, @start_heading_var]]
    %{pose: pose, var: var, likely: 0.0}
  end

  # Whether at least one number of the sighting was within the gate.
  defp correct(guess, sighting, size) do
    %{at: {x, y}, axis: axis} = sighting
    {left, right, near} = Box.edges(guess.pose, size, sighting.at, axis)
    far = max(Pose.distance(guess.pose, sighting.at), 0.5)
    bearing_var = @edge_sd * @edge_sd + square(sighting.sd_heading) + square(sighting.sd / far)

    near_by = fn {cx, cy} -> (cx - x) * :math.cos(axis) + (cy - y) * :math.sin(axis) end

    numbers = [
      {sighting.left && Pose.wrap(sighting.left - bearing(left, {x, y})),
       bearing_row(left, guess.pose, {x, y}), bearing_var},
      {sighting.right && Pose.wrap(sighting.right - bearing(right, {x, y})),
       bearing_row(right, guess.pose, {x, y}), bearing_var},
      {sighting.near && sighting.near - near_by.(near), near_row(near, guess.pose, axis),
       square(0.03 + 0.01 * (sighting.near || 0.0)) + square(sighting.sd)}
    ]

    Enum.reduce(numbers, {guess, false}, fn
      {nil, _row, _var}, result -> result
      {off, row, var}, {guess, inside?} -> update(guess, inside?, off, row, var)
    end)
  end

  defp bearing({cx, cy}, {x, y}), do: :math.atan2(cy - y, cx - x)

  defp bearing_row({cx, cy}, pose, {x, y}) do
    {dx, dy} = {cx - x, cy - y}
    square = max(dx * dx + dy * dy, 0.01)
    {by_x, by_y} = {-dy / square, dx / square}
    [by_x, by_y, by_y * (cx - pose.x) - by_x * (cy - pose.y)]
  end

  defp near_row({cx, cy}, pose, axis) do
    {c, s} = {:math.cos(axis), :math.sin(axis)}
    [c, s, s * (cx - pose.x) - c * (cy - pose.y)]
  end

  # What is known already moves the pose again, since an edge may be another corner by then; but once is enough.
  defp update(guess, inside?, off, row, noise) do
    column = for r <- guess.var, do: dot(r, row)
    spread = dot(row, column) + noise
    likely = guess.likely - min(off * off / spread, @gate * @gate) / 2

    if off * off > @gate * @gate * spread do
      {%{guess | likely: likely}, inside?}
    else
      gain = Enum.map(column, &(&1 / spread))
      [dx, dy, turn] = Enum.map(gain, &(&1 * off))
      pose = Pose.new(guess.pose.x + dx, guess.pose.y + dy, guess.pose.heading + turn)

      var =
        for {r, g, i} <- Enum.zip([guess.var, gain, 0..2]) do
          for {v, c, j} <- Enum.zip([r, column, 0..2]),
              do: if(i == j, do: max(v - g * c, @floor), else: v - g * c)
        end

      {%{pose: pose, var: var, likely: likely}, true}
    end
  end

  defp keep(all) do
    [best | _] = sorted = Enum.sort_by(all, &{-&1.likely, &1.pose.heading})

    sorted
    |> Enum.filter(&(best.likely - &1.likely < @behind))
    |> Enum.reduce([], fn guess, kept ->
      if Enum.any?(kept, &same?(&1.pose, guess.pose)), do: kept, else: kept ++ [guess]
    end)
    |> Enum.map(&%{&1 | likely: &1.likely - best.likely})
  end

  defp same?(a, b),
    do: Pose.distance(a, b) < @same and abs(half(a.heading - b.heading)) < @same_heading

  @doc "An angle that counts modulo half a circle, from -pi/2 to pi/2."
  @spec half(float()) :: float()
  def half(angle) do
    wrapped = Pose.wrap(angle)

    cond do
      wrapped > :math.pi() / 2 -> wrapped - :math.pi()
      wrapped <= -:math.pi() / 2 -> wrapped + :math.pi()
      true -> wrapped
    end
  end

  @doc "The estimate where robots are at these discs; `doubt` is how many times the usual doubt a push adds."
  @spec push(t() | nil, [{float(), float(), float()}], float(), integer()) :: t() | nil
  def push(nil, _discs, _doubt, _at_ms), do: nil

  def push(estimate, discs, doubt, at_ms) do
    {all, ways} =
      estimate.all |> Enum.map(&moved(&1, discs, doubt, estimate.size)) |> Enum.unzip()

    pushed_ms = if hd(ways) > 0.005, do: at_ms, else: estimate.pushed_ms
    %{estimate | all: all, pushed_ms: pushed_ms}
  end

  # One disc after the other, again where one has pushed it into another.
  defp moved(guess, discs, doubt, size) do
    {pose, way} =
      for _round <- 1..4, disc <- discs, reduce: {guess.pose, 0.0} do
        {pose, way} ->
          {pose, more} = Box.pushed(pose, size, disc)
          {pose, way + more}
      end

    [[xx, xy, xt], [yx, yy, yt], [tx, ty, tt]] = guess.var
    {more, turn} = {doubt * way * @way_var, doubt * way * @way_heading_var}
    var = [[xx + more, xy, xt], [yx, yy + more, yt], [tx, ty, tt + turn]]
    {%{guess | pose: pose, var: var}, way}
  end

  @doc "The best pose, and its deviations along its worst axis (at most) and of its heading."
  @spec best(t()) :: {Pose.t(), sd :: float(), sd_heading :: float()}
  def best(%__MODULE__{all: [%{pose: pose, var: [[xx, _, _], [_, yy, _], [_, _, tt]]} | _]}),
    do: {pose, :math.sqrt(max(xx, yy)), :math.sqrt(tt)}

  @doc "How far from where it is believed to be its middle may be, in 95 of 100 cases."
  @spec margin(t()) :: float()
  def margin(%__MODULE__{sd: own} = estimate) do
    {_pose, sd, _sd_heading} = best(estimate)
    2 * :math.sqrt(sd * sd + own * own)
  end

  @doc "Whether one pose is left, and the sightings were enough to be sure of it."
  @spec sure?(t() | nil) :: boolean()
  def sure?(%__MODULE__{all: [_one], seen: seen} = estimate) when seen >= @found do
    {_pose, sd, sd_heading} = best(estimate)
    sd < @sure and sd_heading < @sure_heading
  end

  def sure?(_estimate), do: false

  defp dot(a, b), do: Enum.zip_reduce(a, b, 0.0, &(&1 * &2 + &3))
  defp square(x), do: x * x
end
