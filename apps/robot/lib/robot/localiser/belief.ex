defmodule Robot.Localiser.Belief do
  @moduledoc false
  alias Hal.Pose

  @start_sd {0.03, 0.03, 0.02, 0.055, 0.06, 0.08}
  @base 6
  @way_share 0.01
  @turn_share 0.05
  @turn_per_metre 0.01
  @slip_change 0.005
  @gate 9.0
  @doubt 16
  @doubt_sd {0.3, 0.3, 0.3}
  @most 6
  @moved 1.0

  @enforce_keys [:pose, :p]
  defstruct @enforce_keys ++ [slip: 0.0, scales: {0.0, 0.0}, refused: 0, marks: [], count: 0]

  @type t :: %__MODULE__{}

  @spec new(Pose.t()) :: t()
  def new(%Pose{} = pose) do
    sds = Tuple.to_list(@start_sd)
    p = for {sd, i} <- Enum.with_index(sds), do: for(j <- 0..5, do: if(i == j, do: sd * sd, else: 0.0))
    %__MODULE__{pose: pose, p: p}
  end

  @spec sd(t()) :: {position :: float(), heading :: float()}
  def sd(%__MODULE__{} = belief) do
    {xx, xy, _, yy, _, hh} = covariance(belief)
    half = (xx + yy) / 2
    root = :math.sqrt(max((xx - yy) * (xx - yy) / 4 + xy * xy, 0.0))
    {:math.sqrt(max(half + root, 0.0)), :math.sqrt(max(hh, 0.0))}
  end

  def covariance(%__MODULE__{p: [[xx, xy, xh | _], [_, yy, yh | _], [_, _, hh | _] | _]}),
    do: {xx, xy, xh, yy, yh, hh}

  @spec move(t(), step :: Pose.t()) :: t()
  def move(belief, %Pose{x: x, y: y, heading: h}) when x == 0.0 and y == 0.0 and h == 0.0, do: belief

  def move(belief, step) do
    u = abs(step.heading)
    extra = belief.slip * u
    c = :math.cos(extra / 2)
    s = :math.sin(extra / 2)
    step_ = Pose.new(c * step.x - s * step.y, s * step.x + c * step.y, step.heading + extra)
    pose = Pose.compose(belief.pose, step_)
    way = :math.sqrt(step.x * step.x + step.y * step.y)
    a = -(pose.y - belief.pose.y)
    b = pose.x - belief.pose.x
    along = :math.pow(@way_share * way, 2)
    turned = :math.pow(@turn_share * u, 2) + :math.pow(@turn_per_metre * way, 2)

    p =
      belief.p
      |> carry(a, b, u)
      |> transpose()
      |> carry(a, b, u)
      |> noise([along, along, turned, @slip_change * @slip_change * u])

    %{belief | pose: pose, p: p}
  end

  # F P with F = [1 0 a au/2; 0 1 b bu/2; 0 0 1 u; 0 0 0 1].
  defp carry([x, y, h, s | rest], a, b, u) do
    [mix(x, a, h, a * u / 2, s), mix(y, b, h, b * u / 2, s), mix(h, u, s, 0.0, s), s | rest]
  end

  defp mix([], _, [], _, []), do: []
  defp mix([a | as], p, [b | bs], q, [c | cs]), do: [a + p * b + q * c | mix(as, p, bs, q, cs)]

  defp transpose([[] | _]), do: []
  defp transpose(rows), do: Enum.zip_with(rows, & &1)

  defp noise(rows, []), do: rows
  defp noise(rows, vars), do: noise(rows, vars, 0)
  defp noise(rows, [], _i), do: rows
  defp noise([row | rows], [v | vs], i), do: [List.update_at(row, i, &(&1 + v)) | noise(rows, vs, i + 1)]

  @spec reframe(t(), Pose.point(), float(), float()) :: t()
  def reframe(belief, {x, y}, position_var, h) do
    gx = -(belief.pose.y - y)
    gy = belief.pose.x - x
    [[xx, xy, xh | rx], [yx, yy, yh | ry], [hx, hy, hh | rh] | rest] = belief.p

    %{
      belief
      | p: [
          [xx + position_var + h * gx * gx, xy + h * gx * gy, xh + h * gx | rx],
          [yx + h * gx * gy, yy + position_var + h * gy * gy, yh + h * gy | ry],
          [hx + h * gx, hy + h * gy, hh + h | rh] | rest
        ]
    }
  end

  @spec variance(t(), {float(), float(), float()}) :: float()
  def variance(belief, {a, b, c}) do
    {xx, xy, xh, yy, yh, hh} = covariance(belief)
    a * a * xx + 2 * a * b * xy + 2 * a * c * xh + b * b * yy + 2 * b * c * yh + c * c * hh
  end

  @doc "Where a mark is by now, of which was told where it is and how well that is known."
  def meet(belief, key, at, {along, _across} = sds) do
    case Enum.find_index(belief.marks, &(elem(&1, 0) == key)) do
      nil ->
        belief = if length(belief.marks) >= @most, do: drop(belief, oldest(belief)), else: belief
        {add(belief, key, at, sds), at}

      index ->
        {_key, told, told_sd, _bias, _used} = Enum.at(belief.marks, index)
        moved = Pose.distance(told, at)

        if moved > @moved do
          {belief |> drop(index) |> add(key, at, sds), at}
        else
          variance = moved * moved + max(along * along - 2 * told_sd * told_sd, 0.0)
          belief = belief |> shake(index, variance) |> renew(index, at, if(variance > moved * moved, do: along, else: told_sd))
          {_key, {x, y}, _sd, {bx, by}, _used} = Enum.at(belief.marks, index)
          {belief, {x + bx, y + by}}
        end
    end
  end

  defp oldest(belief) do
    {_, index} = belief.marks |> Enum.with_index() |> Enum.min_by(fn {mark, _} -> elem(mark, 4) end)
    index
  end

  defp shake(belief, _index, v) when v == 0.0, do: belief

  defp shake(belief, index, v) do
    i = @base + 2 * index
    p = belief.p |> List.update_at(i, fn row -> List.update_at(row, i, &(&1 + v)) end) |> List.update_at(i + 1, fn row -> List.update_at(row, i + 1, &(&1 + v)) end)
    %{belief | p: p}
  end

  defp renew(belief, index, at, sd) do
    marks = List.update_at(belief.marks, index, fn {key, _at, _sd, bias, _used} -> {key, at, sd, bias, belief.count} end)
    %{belief | marks: marks, count: belief.count + 1}
  end

  # Along the line of sight and across it.
  defp add(belief, key, {x, y} = at, {along, across}) do
    direction = :math.atan2(y - belief.pose.y, x - belief.pose.x)
    c = :math.cos(direction)
    s = :math.sin(direction)
    xx = along * along * c * c + across * across * s * s
    yy = along * along * s * s + across * across * c * c
    xy = (along * along - across * across) * c * s
    zeros = List.duplicate(0.0, length(belief.p))
    rows = Enum.map(belief.p, &(&1 ++ [0.0, 0.0]))
    p = rows ++ [zeros ++ [xx, xy], zeros ++ [xy, yy]]
    %{belief | p: p, marks: belief.marks ++ [{key, at, along, {0.0, 0.0}, belief.count}], count: belief.count + 1}
  end

  defp drop(belief, index) do
    i = @base + 2 * index
    cut = fn list -> list |> List.delete_at(i) |> List.delete_at(i) end
    %{belief | p: belief.p |> cut.() |> Enum.map(cut), marks: List.delete_at(belief.marks, index)}
  end

  @doc "Without marks."
  def forget(%{marks: []} = belief), do: belief
  def forget(belief), do: %{belief | marks: [], p: belief.p |> Enum.take(@base) |> Enum.map(&Enum.take(&1, @base))}

  def correct(belief, key, error, {a, b, c}, {k, l}, noise) do
    index = 2 * Enum.find_index(belief.marks, &(elem(&1, 0) == key))
    v = Enum.map(belief.p, fn [x, y, h, _s, m, n | rest] -> a * x + b * y + c * h + k * m + l * n - mark(rest, index, a, b) end)
    [vx, vy, vh, vs, vm, vn | rest] = v
    s = a * vx + b * vy + c * vh + k * vm + l * vn - mark(rest, index, a, b) + noise

    if error * error > @gate * s do
      refuse(belief)
    else
      g = error / s
      p = for {row, k} <- Enum.zip(belief.p, v), do: less(row, v, k / s)
      pose = belief.pose
      {m, n} = belief.scales

      %{
        belief
        | pose: Pose.new(pose.x + vx * g, pose.y + vy * g, pose.heading + vh * g),
          slip: belief.slip + vs * g,
          scales: {m + vm * g, n + vn * g},
          p: p,
          marks: shift(belief.marks, rest, g),
          refused: max(belief.refused - 1, 0)
      }
    end
  end

  defp mark([x, y | _], 0, a, b), do: a * x + b * y
  defp mark([_, _ | rest], i, a, b), do: mark(rest, i - 2, a, b)

  defp less([], [], _k), do: []
  defp less([x | xs], [v | vs], k), do: [x - k * v | less(xs, vs, k)]

  defp shift([], [], _g), do: []

  defp shift([{key, at, sd, {bx, by}, used} | marks], [x, y | rest], g),
    do: [{key, at, sd, {bx + x * g, by + y * g}, used} | shift(marks, rest, g)]

  defp refuse(%{refused: refused} = belief) when refused < @doubt,
    do: %{belief | refused: refused + 2}

  defp refuse(belief), do: doubt(belief)

  @spec doubt(t()) :: t()
  def doubt(%__MODULE__{} = belief) do
    {x, y, h} = @doubt_sd
    %{belief | refused: 0, p: noise(belief.p, [x * x, y * y, h * h])}
  end
end
