defmodule Sim.Compute.Columns do
  @moduledoc false
  # Paints one column of a picture at a time, in plain Elixir: the reference for `paint.c`. Pure.
  alias Sim.Compute.Rays

  @nearest 0.01
  @farthest 1.0e6
  @wall_height 2.5
  # A ray meets no side that it is as good as parallel to.
  @parallel 1.0e-9
  # The lamp is mounted beside the camera, 8 degrees to its left.
  @lamp_cosine 0.9902680687415704
  @lamp_sine 0.13917310096006544

  @type paint :: {kind :: byte(), luma :: byte(), u :: byte(), v :: byte()}
  @typedoc "Round, or a box with its halves and the cosine and sine of its x axis; then the radius is that round its corners."
  @type pole ::
          {x :: float(), y :: float(), radius :: float(), height :: float(), paint(),
           nil | {half_x :: float(), half_y :: float(), cosine :: float(), sine :: float()}}
  @type piece :: {top :: non_neg_integer(), bottom :: non_neg_integer(), paint(), luma :: byte()}
  @type room :: {wall_top :: integer(), wall_bottom :: integer(), wall_luma :: byte()}

  @doc """
  The poles of a packed binary that this camera may see, each with the columns it can cover;
  possibly too many, never too few.
  """
  @spec poles(tuple(), binary()) :: [{Range.t(), pole()}]
  def poles(sight, packed) do
    for <<x::float-native, y::float-native, r::float-native, height::float-native,
          half_x::float-native, half_y::float-native, c::float-native, s::float-native, kind,
          luma, u, v <- packed>>,
        range <- [range(sight, x, y, r)],
        range.first <= range.last,
        do: {range, {x, y, r, height, {kind, luma, u, v}, box(half_x, half_y, c, s)}}
  end

  defp box(half_x, _half_y, _c, _s) when half_x == 0.0, do: nil
  defp box(half_x, half_y, c, s), do: {half_x, half_y, c, s}

  defp range({sx, sy, cosine, sine, _eye, focal, _horizon, width, _height}, x, y, r) do
    dx = x - sx
    dy = y - sy
    depth = cosine * dx + sine * dy
    side = cosine * dy - sine * dx
    middle = (width - 1) / 2

    cond do
      depth <= -r ->
        1..0//1

      depth <= 2 * r ->
        0..(width - 1)//1

      true ->
        left = middle - focal * ((side + r) / if(side + r < 0.0, do: depth + r, else: depth - r))

        right = middle - focal * ((side - r) / if(side - r < 0.0, do: depth - r, else: depth + r))

        max(floor(left) - 1, 0)..min(ceil(right) + 1, width - 1)//1
    end
  end

  @doc """
  A column: its wall (`nil` if only the poles are wanted) and the visible parts of poles, the
  nearest first.
  """
  @spec column(tuple(), tuple(), [{Range.t(), pole()}], non_neg_integer(), :poles | :walls) ::
          {room() | nil, [piece()]}
  def column(map, {x, y, cosine, sine, _, focal, _, width, height} = sight, poles, column, what) do
    k = ((width - 1) / 2 - column) / focal
    rx = cosine - sine * k
    ry = sine + cosine * k

    hits =
      for {range, pole} <- poles,
          column in range,
          depth = meet({x, y}, pole, rx, ry),
          do: {depth, pole}

    hits = Enum.sort_by(hits, &elem(&1, 0))

    case {what, List.last(hits)} do
      {:poles, nil} ->
        {nil, []}

      {:poles, {farthest, _}} ->
        {wall, _axis} = Rays.wall(map, x, y, rx, ry, farthest)
        {nil, cut(hits, sight, rx, ry, wall, height)}

      {:walls, _} ->
        {wall, axis} = Rays.wall(map, x, y, rx, ry, @farthest)
        {room(sight, wall, axis), cut(hits, sight, rx, ry, wall, height)}
    end
  end

  defp room({_, _, _, _, eye, focal, horizon, _width, height}, wall, axis) do
    wall = max(wall, @nearest)
    top = ceil(horizon - focal * (@wall_height - eye) / wall)
    bottom = floor(horizon + focal * eye / wall)
    luma = 150 - min(trunc(wall * 4), 70) - if(axis == 1, do: 14, else: 0)
    {top |> max(0) |> min(height), bottom |> max(-1) |> min(height - 1), luma}
  end

  @doc "The depth at which a ray from a place meets a pole from outside; `nil` if it does not."
  @spec meet({float(), float()}, pole(), float(), float()) :: float() | nil
  def meet({sx, sy}, {x, y, _r, _height, _paint, {half_x, half_y, c, s}}, rx, ry) do
    mx = sx - x
    my = sy - y

    with {_, _} = span <-
           between({-@farthest, @farthest}, mx * c + my * s, rx * c + ry * s, half_x),
         {enters, leaves} <- between(span, my * c - mx * s, ry * c - rx * s, half_y),
         true <- enters > 0.0 and enters <= leaves do
      max(enters, @nearest)
    else
      _beside -> nil
    end
  end

  def meet({sx, sy}, {x, y, r, _height, _paint, nil}, rx, ry) do
    mx = x - sx
    my = y - sy
    a = rx * rx + ry * ry
    b = mx * rx + my * ry
    under = b * b - a * (mx * mx + my * my - r * r)
    if b > 0.0 and under >= 0.0, do: max((b - :math.sqrt(under)) / a, @nearest)
  end

  # Where of this span a ray is between two sides of a box.
  defp between(span, at, along, half) when along < @parallel and along > -@parallel,
    do: if(at < half and at > -half, do: span)

  defp between({enters, leaves}, at, along, half) do
    low = (-half - at) / along
    high = (half - at) / along
    {max(enters, min(low, high)), min(leaves, max(low, high))}
  end

  # All poles stand on the floor, so a nearer one hides everything below its upper edge.
  defp cut([{depth, pole} | rest], sight, rx, ry, wall, covered)
       when covered > 0 and depth <= wall do
    {_, _, _, _, eye, focal, horizon, _, _} = sight
    {_, _, _, height, paint, _} = pole
    top = max(ceil(horizon - focal * (height - eye) / depth), 0)
    bottom = min(floor(horizon + focal * eye / depth), covered - 1)

    if top <= bottom do
      piece = {top, bottom, paint, luma(sight, pole, rx, ry, depth)}
      [piece | cut(rest, sight, rx, ry, wall, top)]
    else
      cut(rest, sight, rx, ry, wall, covered)
    end
  end

  defp cut(_hits, _sight, _rx, _ry, _wall, _covered), do: []

  defp luma({sx, sy, _, _, _, _, _, _, _}, pole, rx, ry, depth) do
    {x, y, _r, _height, {_, paint, _, _}, _box} = pole
    {nx, ny} = normal(pole, sx + rx * depth - x, sy + ry * depth - y)
    length = :math.sqrt(rx * rx + ry * ry)
    lx = (ry * @lamp_sine - rx * @lamp_cosine) / length
    ly = (0.0 - rx * @lamp_sine - ry * @lamp_cosine) / length
    shade = 0.6 + 0.4 * (nx * lx + ny * ly)
    trunc(paint * shade + 0.5) |> max(0) |> min(255)
  end

  # Where the surface faces on which a ray meets a pole, at this place from its middle.
  defp normal({_, _, r, _height, _paint, nil}, mx, my), do: {mx / r, my / r}

  defp normal({_, _, _r, _height, _paint, {half_x, half_y, c, s}}, mx, my) do
    along = (mx * c + my * s) / half_x
    across = (my * c - mx * s) / half_y
    finish = if along < 0.0, do: -1.0, else: 1.0
    flank = if across < 0.0, do: -1.0, else: 1.0

    if along * finish >= across * flank,
      do: {finish * c, finish * s},
      else: {0.0 - flank * s, flank * c}
  end
end
