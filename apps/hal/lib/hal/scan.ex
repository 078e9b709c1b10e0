defmodule Hal.Scan do
  @moduledoc """
  Holds a turn of a lidar: how far it is in many directions. Pure. Metres and radians, seen from the lidar; where that is on
  the body, and between which ranges it measures, says the body's `scan:` (`Hal.Profile`).

  Ray `i` looks in direction `start + i * step`, left positive. `ranges` has two bytes a ray, big-endian: millimetres, 65535 for a
  ray without an answer, and 0 for one that was not measured. No answer comes from what is farther than a lidar reaches, and from
  what is nearer than it measures, black, or slanted; no lidar of ours tells these apart. As with sonars, it shows nothing that
  is in the way, and maps take it for a sign of free space, a weak one.

  What is written for sonars serves lidars, too: `beams/2` makes of a scan the nearest range in each of some cones of 10
  degrees, and `ring/1` the body that has these in the place of its sonars. A percept has both (`Robot.Percept.Snapshot`);
  only the near stop looks at each ray (`Robot.Safety.Reflex`).
  """
  alias Hal.{Pose, Profile}

  @enforce_keys [:start, :step, :ranges]
  defstruct @enforce_keys

  @type t :: %__MODULE__{start: float(), step: float(), ranges: binary()}

  # The width of a beam, and how many there are at most.
  @beam :math.pi() / 18
  @most 36
  @silent 65_535

  @doc "What a ray without an answer has for millimetres."
  @spec silent() :: 65_535
  def silent, do: @silent

  @doc """
  A range in metres (a number; `nil` for a ray that was not measured, `:silent` for one without an answer) as a scan has it.

      iex> for range <- [1.2344, nil, :silent, 99.0], do: Hal.Scan.pack(range)
      [<<1234::16>>, <<0::16>>, <<65535::16>>, <<65535::16>>]
  """
  @spec pack(number() | nil | :silent) :: <<_::16>>
  def pack(nil), do: <<0::16>>
  def pack(:silent), do: <<@silent::16>>
  def pack(range) when is_number(range), do: <<min(round(range * 1000), @silent)::16>>

  @doc "Whether a term is a scan with which one can calculate: it may come from a driver of a user."
  @spec whole?(term()) :: boolean()
  def whole?(%__MODULE__{start: start, step: step, ranges: ranges}),
    do:
      is_float(start) and is_float(step) and abs(start) < 100 and abs(step) < 10 and
        is_binary(ranges) and rem(byte_size(ranges), 2) == 0

  def whole?(_other), do: false

  @doc """
  The echoes of a scan up to `most` metres from the lidar: directions from it, and ranges.

      iex> scan = %Hal.Scan{start: 0.0, step: 0.5, ranges: <<1000::16, 0::16, 3000::16, 65535::16, 500::16>>}
      iex> Hal.Scan.echoes(scan, 2.0)
      [{0.0, 1.0}, {2.0, 0.5}]
  """
  @spec echoes(t(), most :: float()) :: [{direction :: float(), range :: float()}]
  def echoes(%__MODULE__{start: start, step: step, ranges: ranges}, most),
    do: echoes(ranges, start, step, 0, most * 1000)

  defp echoes(<<mm::16, rest::binary>>, start, step, i, most)
       when mm > 0 and mm <= most and mm < @silent,
       do: [{start + i * step, mm / 1000} | echoes(rest, start, step, i + 1, most)]

  defp echoes(<<_mm::16, rest::binary>>, start, step, i, most),
    do: echoes(rest, start, step, i + 1, most)

  defp echoes(_end, _start, _step, _i, _most), do: []

  @doc """
  The body with the beams of its lidar (`beams/2`) in the place of its sonars; any other as it is.

      iex> ring = Hal.Scan.ring(%{Hal.Profile.magellan() | scan: Hal.Profile.scan()})
      iex> {length(ring.sonars), ring.sonar_max, Float.round(ring.sonar_cone, 3)}
      {36, 12.0, 0.175}
  """
  @spec ring(Profile.t()) :: Profile.t()
  def ring(%Profile{scan: nil} = profile), do: profile

  def ring(%Profile{scan: %{pose: %Pose{heading: heading} = pose} = scan} = profile) do
    {count, width} = sectors(scan)

    sonars =
      for k <- 0..(count - 1),
          do: %{pose | heading: heading - scan.field_of_view / 2 + (k + 0.5) * width}

    %{
      profile
      | sonars: sonars,
        sonar_min: scan.min,
        sonar_max: scan.max,
        sonar_cone: width
    }
  end

  defp sectors(%{field_of_view: field_of_view}) do
    count = round(field_of_view / @beam) |> max(1) |> min(@most)
    {count, field_of_view / count}
  end

  @doc """
  The nearest range in each beam of a lidar, from the right to the left of what it sees; `scan` is that of the body. The
  greatest range where no ray was answered, `nil` where none was measured.

      iex> scan = %{Hal.Profile.scan() | field_of_view: :math.pi() / 9, max: 4.0}
      iex> rays = fn list -> %Hal.Scan{start: -0.16, step: 0.08, ranges: for(mm <- list, into: <<>>, do: <<mm::16>>)} end
      iex> for list <- [[900, 800, 0, 700, 0], [0, 0, 65535, 5000, 0]], do: Hal.Scan.beams(rays.(list), scan)
      [[0.8, 0.7], [nil, 4.0]]
  """
  @spec beams(t(), Profile.scan()) :: [float() | nil]
  def beams(%__MODULE__{start: start, step: step, ranges: ranges}, scan) do
    {count, width} = sectors(scan)
    turn = 2 * :math.pi()
    half = scan.field_of_view / 2

    # Half a millionth of a ray: what is on a border is on the same side of it whatever was rounded.
    first = start + half + 1.0e-6

    sector = fn i ->
      angle = first + i * step
      floor((angle - turn * floor(angle / turn)) / width)
    end

    nearest = nearest(ranges, 0, sector, round(scan.max * 1000), nil, @silent + 1, %{})
    for k <- 0..(count - 1), do: range(nearest, k, scan.max)
  end

  defp range(nearest, k, max) do
    case nearest do
      %{^k => @silent} -> max
      %{^k => mm} when mm < @silent -> mm / 1000
      _nothing -> nil
    end
  end

  # Rays lie side by side, so most are in the sector of the one before.
  defp nearest(<<mm::16, rest::binary>>, i, sector, max, last, least, all) do
    mm = if mm == 0, do: @silent + 1, else: if(mm >= max, do: @silent, else: mm)

    case sector.(i) do
      ^last -> nearest(rest, i + 1, sector, max, last, min(least, mm), all)
      next -> nearest(rest, i + 1, sector, max, next, mm, keep(all, last, least))
    end
  end

  defp nearest(<<>>, _i, _sector, _max, last, least, all), do: keep(all, last, least)

  defp keep(all, nil, _least), do: all
  defp keep(all, sector, least), do: Map.update(all, sector, least, &min(&1, least))
end
