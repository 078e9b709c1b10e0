defmodule Robot.Localiser.MonteCarlo.Reference do
  @moduledoc """
  Computes what `Robot.Localiser.MonteCarlo` asks of its kernels, in Elixir: how particles move, where they fall at random, and how
  well readings of sonars fit a floor plan from each of them. The kernels in C give the same bytes, because both call the C
  library's functions in the same order. Pure.

  A particle is four floats: x, y (metres), heading (radians) and slip, the share by which it turns farther left, and less far
  right, than by odometry. All floats have 64 bits and this machine's order of bytes. A `draw` is 32 bits of which each call needs
  others: its random numbers are hashes of these bits, the number of the particle and their use.
  """
  import Bitwise
  alias Hal.Pose

  @mask 0xFFFFFFFF
  @unit 0.02
  # A point is at most this share of a cell from the centre of its cell; the least step of a ray (cells).
  @off 0.71
  @least_step 0.6
  # A ray beside the axis is nearer if it is so by this (metres).
  @nearer 0.03
  # A reading fits if it is not farther off (metres).
  @fits 0.2
  # A wall that is nearer than the range by this much (metres) has not sent the echo.
  @far_off 0.6
  # So many places are tried until one is free.
  @tries 64
  @within_wall -65_536
  # Entries of a table of likelihoods.
  @entries 601

  @type draw :: 0..0xFFFFFFFF
  @typedoc "The clearances of a `Nav.Grid`, its width and height, the width of a cell, and its lower left corner."
  @type plan ::
          {binary(), pos_integer(), pos_integer(), float(), left :: float(), low :: float()}

  @doc """
  The particles after a step: seven floats, the pose that odometry has counted, the sum of the angles turned, and the standard
  deviations of what it has missed: of x and y, of the heading and of the slip.
  """
  @spec move(poses :: binary(), step :: binary(), draw()) :: binary()
  def move(poses, step, draw) do
    <<dx::float-native, dy::float-native, turn::float-native, turned::float-native,
      place_sd::float-native, heading_sd::float-native, slip_sd::float-native>> = step

    for {{x, y, heading, slip}, k} <- Enum.with_index(unpack(poses)), into: <<>> do
      use = 4 * k
      more = slip * turned + heading_sd * gauss(draw, use)
      {c, s} = {:math.cos(heading + more / 2), :math.sin(heading + more / 2)}
      x = x + (c * dx - s * dy) + place_sd * gauss(draw, use + 1)
      y = y + (s * dx + c * dy) + place_sd * gauss(draw, use + 2)
      pack({x, y, Pose.wrap(heading + turn + more), slip + slip_sd * gauss(draw, use + 3)})
    end
  end

  @doc "As many particles in random places of this clearance (units of 2 cm), with slips of this standard deviation."
  @spec scatter(non_neg_integer(), plan(), 0..255, float(), draw()) :: binary()
  def scatter(count, {_clear, _width, _height, cell, left, low} = map, need, slip_sd, draw) do
    for k <- 0..(count - 1)//1, into: <<>> do
      use = k * (2 * @tries + 2)
      {u, v} = place(map, need, draw, use + 2, @tries)
      heading = :math.pi() - unit(draw, use) * 2 * :math.pi()
      pack({left + u * cell, low + v * cell, heading, slip_sd * gauss(draw, use + 1)})
    end
  end

  defp place({_clear, width, height, _cell, _left, _low} = map, need, draw, use, left) do
    {u, v} = {unit(draw, use) * width, unit(draw, use + 1) * height}

    if left == 1 or clear(map, u, v) >= need,
      do: {u, v},
      else: place(map, need, draw, use + 2, left - 1)
  end

  @doc """
  For each particle two whole numbers of 32 bits: the sum of the logarithms of the likelihoods (1/1024), and how many of the
  readings that count fit. One inside of a wall has the sum -65536.

  A reading is fifteen floats: the place of the sonar on the body, the directions of five rays (cosine and sine) across its cone,
  the axis first and its borders last, the range, how far walls are looked for (metres), and whether it counts (above zero). The
  expected range is that of the nearest wall on a ray. `tables` are two of #{@entries} whole numbers of 16 bits: the logarithm by how
  much longer a range is than expected, in steps of 2 cm, zero in the middle; the second one is for walls that only the border
  of the cone meets, which throw the echo elsewhere.
  """
  @spec weigh(poses :: binary(), plan(), readings :: binary(), tables :: binary()) :: binary()
  def weigh(poses, {_clear, _width, _height, cell, left, low} = map, readings, tables) do
    readings = readings(readings)

    for {x, y, heading, _slip} <- unpack(poses), into: <<>> do
      {sum, fits} =
        if clear(map, (x - left) / cell, (y - low) / cell) == 0,
          do: {@within_wall, 0},
          else: weigh({x, y, :math.cos(heading), :math.sin(heading)}, map, readings, tables, 0, 0)

      <<sum::32-signed-native, fits::32-signed-native>>
    end
  end

  defp weigh(_at, _map, [], _tables, sum, fits), do: {sum, fits}

  defp weigh({x, y, c, s} = at, map, [{sx, sy, rays, range, most, counts} | rest], tables, sum, n) do
    {_clear, _width, _height, cell, left, low} = map
    from = {(x + c * sx - s * sy - left) / cell, (y + s * sx + c * sy - low) / cell}
    # Whether a wall is yet nearer makes no difference.
    worst = (range - @far_off) / cell

    {best, border} =
      for {{dx, dy}, r} <- Enum.with_index(rays), reduce: {most / cell, 0} do
        {best, border} ->
          along = {c * dx - s * dy, s * dx + c * dy}
          t = if best > worst, do: cast(map, @unit / cell, from, along, best, 0.0), else: best
          nearer? = t < best - @nearer / cell
          if nearer?, do: {t, if(r > 2, do: @entries, else: 0)}, else: {best, border}
      end

    longer = range - best * cell
    at_entry = (longer / @unit + (div(@entries, 2) + 0.5)) |> max(0.0) |> min(@entries - 1.0)
    <<entry::16-signed-native>> = binary_part(tables, 2 * (border + trunc(at_entry)), 2)
    fits = if counts > 0.0 and longer < @fits and longer > -@fits, do: n + 1, else: n
    weigh(at, map, rest, tables, sum + entry, fits)
  end

  # How far a ray comes, in cells.
  defp cast(_map, _per, _from, _along, most, t) when t >= most, do: t

  defp cast(map, per, {u, v} = from, {c, s} = along, most, t) do
    case clear(map, u + t * c, v + t * s) do
      0 ->
        t

      clear ->
        step = clear * per - @off
        cast(map, per, from, along, most, t + if(step > @least_step, do: step, else: @least_step))
    end
  end

  # A place in cells.
  defp clear({clear, width, height, _cell, _left, _low}, u, v) do
    if u >= 0.0 and v >= 0.0 and u < width and v < height,
      do: :binary.at(clear, trunc(v) * width + trunc(u)),
      else: 0
  end

  defp readings(packed) do
    for <<x::float-native, y::float-native, rays::binary-size(80), range::float-native,
          most::float-native, counts::float-native <- packed>> do
      rays = for <<c::float-native, s::float-native <- rays>>, do: {c, s}
      {x, y, if(counts > 0.0, do: rays, else: [hd(rays)]), range, most, counts}
    end
  end

  @doc "The particles of a binary."
  @spec unpack(binary()) :: [{x :: float(), y :: float(), heading :: float(), slip :: float()}]
  def unpack(poses) do
    for <<x::float-native, y::float-native, heading::float-native, slip::float-native <- poses>>,
      do: {x, y, heading, slip}
  end

  @doc "A particle as the kernels take it."
  @spec pack({float(), float(), float(), float()}) :: binary()
  def pack({x, y, heading, slip}),
    do: <<x::float-native, y::float-native, heading::float-native, slip::float-native>>

  @doc """
  32 bits of two numbers.

      iex> alias Robot.Localiser.MonteCarlo.Reference
      iex> Reference.hash(1, 2) == Reference.hash(1, 2) and Reference.hash(1, 2) != Reference.hash(1, 3)
      true
  """
  @spec hash(draw(), use :: integer()) :: draw()
  def hash(draw, use), do: bxor(draw, use &&& @mask) |> mix() |> mix()

  # The factors have 27 bits, so that Elixir never leaves its small integers.
  defp mix(x) do
    x = x + 0x9E3779B9 &&& @mask
    x = bxor(x, x >>> 16) * 0x5BD1E95 &&& @mask
    x = bxor(x, x >>> 13) * 0x6C8E9CF &&& @mask
    bxor(x, x >>> 16)
  end

  defp unit(draw, use), do: hash(draw, use) / 4_294_967_296.0

  # Nearly normal: the sum of four bytes.
  defp gauss(draw, use) do
    h = hash(draw, use)
    ((h &&& 255) + (h >>> 8 &&& 255) + (h >>> 16 &&& 255) + (h >>> 24) - 510) / 147.8
  end
end
