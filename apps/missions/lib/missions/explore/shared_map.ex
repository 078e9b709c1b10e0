defmodule Missions.Explore.SharedMap do
  @moduledoc false
  # Keeps the map of the fleet as one robot has it: what its own sonars have seen (`Nav.Survey`), and where
  # these say nothing, what others told last. Pure.
  #
  # Robots tell each other tiles of 1.6 x 1.6 m, two bits a cell: those in which they have seen something new, and in turn a few
  # tiles of everything known, from any source, so latecomers catch up, and what a robot has told is not lost with it.
  alias Hal.Pose
  alias Nav.MapFile.Writer
  alias Nav.Survey
  alias Robot.Percept

  @tile Survey.tile()
  @bytes 4 + div(@tile * @tile, 4)
  @unknown <<0::size(@tile * @tile)-unit(8)>>
  # So many tiles are told at once, so many of them again.
  @most 14
  @again 3
  # Tiles each way from that in which the robot began, 48 m; others are not heard.
  @far 30

  @enforce_keys [:survey]
  defstruct @enforce_keys ++ [home: nil, told: %{}, tiles: %{}, news: [], last: nil, free: 0]

  @typedoc """
  `told` and `tiles`, which is all that is known, are states by tile; `news` are the tiles that are to be told, `last` is the
  one that was told again last, `free` the number of free cells, `home` the tile in which the robot began.
  """
  @type t :: %__MODULE__{
          survey: Survey.t(),
          home: Survey.tile() | nil,
          told: %{Survey.tile() => Survey.states()},
          tiles: %{Survey.tile() => Survey.states()},
          news: [Survey.tile()],
          last: Survey.tile() | nil,
          free: non_neg_integer()
        }

  @doc "A map on which nothing is."
  @spec new() :: t()
  def new, do: %__MODULE__{survey: Survey.new()}

  @doc "The free area, m2."
  @spec area(t()) :: float()
  def area(%__MODULE__{free: free}), do: free * Survey.cell() * Survey.cell()

  @doc """
  What is drawn of it (`t:Robot.Mission.layer/0`): the tiles of which something is known.

      iex> Missions.Explore.SharedMap.layer(%{Missions.Explore.SharedMap.new() | tiles: %{{0, -1} => <<1>>}})
      {:cells, "mapped", 1.6, [{0.8, -0.8}]}
  """
  @spec layer(t()) :: {:cells, String.t(), size_m :: float(), [Pose.point()]}
  def layer(%__MODULE__{tiles: tiles}) do
    size = @tile * Survey.cell()
    middles = for {i, j} <- Enum.sort(Map.keys(tiles)), do: {(i + 0.5) * size, (j + 0.5) * size}
    {:cells, "mapped", size, middles}
  end

  @doc "How good the map is by what the robot itself has heard, to be added to what it says; `nil` without a wall."
  @spec good(t()) :: String.t() | nil
  def good(%__MODULE__{survey: survey}) do
    with {sure, walls} when walls > 0 <- Survey.confirmed(survey),
         do: ", walls #{round(100 * sure / walls)} % confirmed",
         else: (_no_wall -> nil)
  end

  @doc "The greatest distance from where a robot began at which it knows anything, metres."
  @spec far() :: float()
  def far, do: @far * @tile * Survey.cell()

  @doc "Takes what the robot's sonars have seen."
  @spec look(t(), Percept.t()) :: t()
  def look(map, %Percept{pose: pose} = percept) do
    map = %{map | home: map.home || Survey.tile_of(Pose.point(pose))}
    {survey, changed} = Survey.update(map.survey, percept)

    changed
    |> Enum.filter(&near?(map, &1))
    |> Enum.reduce(%{map | survey: survey}, fn at, map ->
      case merge(map, at) do
        ^map -> map
        other -> %{other | news: if(at in other.news, do: other.news, else: other.news ++ [at])}
      end
    end)
  end

  defp near?(%{home: {i, j}}, {column, row}),
    do: abs(column - i) <= @far and abs(row - j) <= @far

  defp merge(map, at) do
    before = Map.get(map.tiles, at, @unknown)
    seen = join(Survey.states(map.survey, at), Map.get(map.told, at))
    # What was known once is not unknown again, however the evidence wavers.
    now = join(seen, before)

    if now == before,
      do: map,
      else: %{
        map
        | tiles: Map.put(map.tiles, at, now),
          free: map.free - free(before) + free(now)
      }
  end

  defp join(states, nil), do: states
  defp join(over, under), do: join(over, under, <<>>)
  defp join(<<0, a::binary>>, <<s, b::binary>>, done), do: join(a, b, <<done::binary, s>>)
  defp join(<<s, a::binary>>, <<_, b::binary>>, done), do: join(a, b, <<done::binary, s>>)
  defp join(<<>>, <<>>, done), do: done

  defp free(states), do: for(<<1 <- states>>, reduce: 0, do: (count -> count + 1))

  @doc "What is to be told now."
  @spec tell(t()) :: {binary(), t()}
  def tell(%__MODULE__{news: news, tiles: tiles} = map) do
    {now, later} = Enum.split(news, @most - @again)
    known = tiles |> Map.keys() |> Enum.sort()
    {before, rest} = Enum.split_while(known, &(map.last != nil and &1 <= map.last))
    again = (rest ++ before) |> Enum.take(@most - length(now)) |> Enum.take(3 * @again)
    packed = for at <- Enum.uniq(now ++ again), into: <<>>, do: pack(at, tiles[at])
    {packed, %{map | news: later, last: List.last(again)}}
  end

  defp pack({i, j}, states) do
    cells = for <<state <- states>>, into: <<>>, do: <<state::2>>
    <<i::signed-16, j::signed-16, cells::binary>>
  end

  @doc """
  Whether a term is what `tell/1` may return.

      iex> for term <- [<<>>, <<0::544>>, <<0>>, :junk, <<0::8160>>], do: Missions.Explore.SharedMap.told?(term)
      [true, true, false, false, false]
  """
  @spec told?(term()) :: boolean()
  def told?(term),
    do:
      is_binary(term) and rem(byte_size(term), @bytes) == 0 and byte_size(term) <= @most * @bytes

  @doc "Takes what another robot told. Tiles that are too far away are not taken, nor any before the robot knows its place."
  @spec hear(t(), binary()) :: t()
  def hear(%__MODULE__{home: nil} = map, _packed), do: map

  def hear(map, packed) do
    for <<i::signed-16, j::signed-16, cells::binary-size(@bytes - 4) <- packed>>,
        near?(map, {i, j}),
        reduce: map do
      map -> hear(map, {i, j}, for(<<state::2 <- cells>>, into: <<>>, do: <<rem(state, 3)>>))
    end
  end

  defp hear(map, at, states) do
    told = join(states, Map.get(map.told, at))
    map = merge(%{map | told: Map.put(map.told, at, told)}, at)
    if map.tiles[at] == states, do: %{map | news: List.delete(map.news, at)}, else: map
  end

  @doc "The same with the robot's own walls as unknown of which it has heard little (`Nav.Survey.doubt/3`)."
  @spec doubted(t()) :: Writer.raster()
  def doubted(%__MODULE__{tiles: tiles, survey: survey} = map),
    do:
      raster(%{
        map
        | tiles: Map.new(tiles, fn {at, states} -> {at, Survey.doubt(survey, at, states)} end)
      })

  @doc "All that is known, as one rectangle."
  @spec raster(t()) :: Writer.raster()
  def raster(%__MODULE__{tiles: tiles}) when tiles == %{},
    do: %{cells: <<>>, width: 0, height: 0, left: 0, low: 0, cell: Survey.cell()}

  def raster(%__MODULE__{tiles: tiles}) do
    {left, right} = tiles |> Map.keys() |> Enum.map(&elem(&1, 0)) |> Enum.min_max()
    {low, high} = tiles |> Map.keys() |> Enum.map(&elem(&1, 1)) |> Enum.min_max()

    cells =
      for j <- low..high, into: <<>> do
        row = for i <- left..right, do: Map.get(tiles, {i, j}, @unknown)

        for k <- 0..(@tile - 1),
            tile <- row,
            into: <<>>,
            do: binary_part(tile, k * @tile, @tile)
      end

    %{
      cells: cells,
      width: (right - left + 1) * @tile,
      height: (high - low + 1) * @tile,
      left: left * @tile,
      low: low * @tile,
      cell: Survey.cell()
    }
  end
end
