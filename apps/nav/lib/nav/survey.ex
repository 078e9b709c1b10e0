defmodule Nav.Survey do
  @moduledoc """
  Records what a robot's sonars have seen of a building since it began, in the frame of the map: evidence for cells of 10 cm, in
  tiles of 16 x 16 cells that are there where something was seen. Pure.

  Readings count as in `Nav.OccupancyGrid` and by its kernels, but at the pose that the robot estimated at that
  moment, and for ever: a later correction of the pose moves nothing. Each cell is unknown, free (seen through more than
  once) or wall (several echoes), which may change as often as it is looked at.
  """
  alias Hal.Pose
  alias Nav.OccupancyGrid
  alias Nav.OccupancyGrid.Cones

  @cell Cones.cell()
  @tile 16
  # Readings reach into so many tiles round that of the robot: 2 are 3.2 m.
  @around 2
  @window (2 * @around + 1) * @tile
  # A building larger than this, 160 x 160 m, is not surveyed to its end.
  @most 10_000
  # Evidence from which on a cell is surely wall, and surely free: three echoes, two looks.
  @wall 30
  @free -8
  # Evidence below which a wall is doubted: the most there is, of six echoes.
  @sure 60
  @fresh <<0::size(@tile * @tile)-unit(8)>>
  # How far (metres) another robot may be from where it tells, if one of the two is unsure of its place.
  @unsure 1.0

  defstruct tiles: %{}, at_ms: nil, pose: nil

  @typedoc "A tile by its column and row: it begins 1.6 m times these from the origin of the map."
  @type tile :: {integer(), integer()}
  @typedoc "The states of a tile's cells, a byte each, rows from the lowest y: 0 unknown, 1 free, 2 wall."
  @type states :: <<_::2048>>
  @typedoc "`tiles` have a signed byte of evidence for each cell; the last readings were taken at `at_ms`, at this odometry."
  @type t :: %__MODULE__{
          tiles: %{tile() => binary()},
          at_ms: integer() | nil,
          pose: Pose.t() | nil
        }

  @doc "A survey in which nothing was seen."
  @spec new() :: t()
  def new, do: %__MODULE__{}

  @doc "The width of a cell, metres."
  @spec cell() :: float()
  def cell, do: @cell

  @doc "The cells along a side of a tile."
  @spec tile() :: pos_integer()
  def tile, do: @tile

  @doc "The tile in which a point is."
  @spec tile_of(Pose.point()) :: tile()
  def tile_of({x, y}), do: {floor(x / (@cell * @tile)), floor(y / (@cell * @tile))}

  @doc """
  Takes the readings of a percept, if they are new and the robot knows where it is. Also returns the tiles that may have
  changed.
  """
  @spec update(t(), Nav.percept()) :: {t(), [tile()]}
  def update(survey, %{pose: pose, odometry: odometry, uncertainty: uncertainty})
      when pose == nil or odometry == nil or (uncertainty != nil and uncertainty.lost?),
      do: {survey, []}

  def update(survey, percept) do
    if Cones.due?(percept, survey.at_ms, survey.pose),
      do: add(survey, percept),
      else: {survey, []}
  end

  defp add(survey, %{pose: pose} = percept) do
    {i, j} = tile_of(Pose.point(pose))
    {left, low} = corner = {(i - @around) * @tile, (j - @around) * @tile}
    known = known(percept)
    own = {pose.x, pose.y, percept.profile.radius}

    {cells, _changes} =
      OccupancyGrid.kernel().add(
        window(survey.tiles, {i, j}),
        @window,
        0,
        0,
        0,
        Cones.pack(percept, pose, known, corner, unsure(percept)),
        :math.tan(percept.profile.sonar_cone / 2),
        Cones.thick(),
        Cones.discs([own | known], corner),
        @wall
      )

    {tiles, changed} = cut(survey.tiles, cells, {div(left, @tile), div(low, @tile)})
    {%{survey | tiles: tiles, at_ms: percept.at_ms, pose: percept.odometry.pose}, changed}
  end

  defp known(percept) do
    robots = for {_id, peer} <- percept.peers, do: {peer.pose.x, peer.pose.y, peer.radius}
    robots |> Enum.sort() |> Enum.take(100)
  end

  defp unsure(%{uncertainty: %{radius: radius}}), do: min(radius, @unsure)
  defp unsure(_percept), do: 0.0

  defp window(tiles, {i, j}) do
    for row <- (j - @around)..(j + @around), into: <<>> do
      tiles =
        for column <- (i - @around)..(i + @around), do: Map.get(tiles, {column, row}, @fresh)

      for k <- 0..(@tile - 1),
          tile <- tiles,
          into: <<>>,
          do: binary_part(tile, k * @tile, @tile)
    end
  end

  # The tiles of the window that are others than before.
  defp cut(tiles, cells, {left, low}) do
    for row <- 0..(2 * @around), column <- 0..(2 * @around), reduce: {tiles, []} do
      {tiles, changed} ->
        at = {left + column, low + row}

        cut =
          for k <- 0..(@tile - 1),
              into: <<>>,
              do: binary_part(cells, (row * @tile + k) * @window + column * @tile, @tile)

        if cut != Map.get(tiles, at, @fresh) and
             (is_map_key(tiles, at) or map_size(tiles) < @most),
           do: {Map.put(tiles, at, cut), [at | changed]},
           else: {tiles, changed}
    end
  end

  @doc """
  The states of the cells of a tile.

      iex> survey = %Nav.Survey{tiles: %{{0, 0} => <<-8::signed, 30, 29, 0::2024>>}}
      iex> <<a, b, c, _::binary>> = Nav.Survey.states(survey, {0, 0})
      iex> {a, b, c, Nav.Survey.states(survey, {1, 0}) == <<0::2048>>}
      {1, 2, 0, true}
  """
  @spec states(t(), tile()) :: states()
  def states(%__MODULE__{tiles: tiles}, at),
    do: for(<<evidence::signed <- Map.get(tiles, at, @fresh)>>, into: <<>>, do: state(evidence))

  @doc """
  The states of a tile (of `states/2`, or told by others), with the walls as unknown for which there are few echoes. Those from
  the sides of a passage may come from anywhere in the cones of the sonars that slant to it, and close it.

      iex> survey = %Nav.Survey{tiles: %{{0, 0} => <<-8::signed, 30, 60, 0::2024>>}}
      iex> states = <<1, 2, 2, 2, 0::2016>>
      iex> <<a, b, c, d, _::binary>> = Nav.Survey.doubt(survey, {0, 0}, states)
      iex> {a, b, c, d}
      {1, 0, 2, 2}
  """
  @spec doubt(t(), tile(), states()) :: states()
  def doubt(%__MODULE__{tiles: tiles}, at, states),
    do: doubted(Map.get(tiles, at, @fresh), states, <<>>)

  defp doubted(<<e::signed, a::binary>>, <<2, b::binary>>, done) when e >= @wall and e < @sure,
    do: doubted(a, b, <<done::binary, 0>>)

  defp doubted(<<_, a::binary>>, <<s, b::binary>>, done),
    do: doubted(a, b, <<done::binary, s>>)

  defp doubted(<<>>, <<>>, done), do: done

  @doc """
  The number of all cells of wall, and of those that later looks confirmed: with the most evidence there is, twice what makes a
  wall.

      iex> survey = %Nav.Survey{tiles: %{{0, 0} => <<-8::signed, 30, 60, 59, 0::2016>>}}
      iex> Nav.Survey.confirmed(survey)
      {1, 3}
  """
  @spec confirmed(t()) :: {confirmed :: non_neg_integer(), walls :: non_neg_integer()}
  def confirmed(%__MODULE__{tiles: tiles}) do
    for {_at, cells} <- tiles, <<evidence::signed <- cells>>, evidence >= @wall, reduce: {0, 0} do
      {sure, walls} -> {if(evidence >= @sure, do: sure + 1, else: sure), walls + 1}
    end
  end

  defp state(evidence) when evidence >= @wall, do: <<2>>
  defp state(evidence) when evidence <= @free, do: <<1>>
  defp state(_evidence), do: <<0>>
end
