defmodule Missions.Explore.FoundMarks do
  @moduledoc """
  Keeps where printed marks hang, as robots that explore have seen them: each robot's sightings of a mark are one place with its uncertainty, and those
  of all robots are one again (`Robot.Localiser.MarkPlace`). Pure; metres and radians in the map frame, on the air whole millimetres and milliradians.

  A sighting counts when the mark was read in three frames in a row, by a robot that is not lost. One at another robot does not: that may
  bear the mark. Once a second a robot tells one of those that it has seen itself, in turn. A mark
  at whose place robots contradict each other is nowhere: two hang there with one number, or a robot is elsewhere than it believes.
  """
  alias Hal.Pose
  alias Robot.Localiser.{Anchors, MarkPlace}
  alias Robot.Percept
  alias Vision.Marks.Streaks

  # So many are kept, of so many robots.
  @most 256
  @most_robots 64
  @far_mm 10_000_000
  @most_mm2 100_000_000
  # The greatest standard deviation that can be told, and how far beside a robot's body a mark that it bears may be read (metres).
  @worst 10.0
  @borne 0.5

  defstruct streaks: %{}, at_ms: nil, own: %{}, told: %{}, known: %{}, last: nil

  @typedoc "Where a mark is, and which way it faces (radians) with its standard deviation, `nil` where no robot could tell."
  @type seen :: {MarkPlace.t(), {turn :: float(), sd :: float()} | nil}

  @typedoc "`own` is what this robot has seen, `told` what others tell of it, by mark and robot; `known` what follows from
  both; `last` the mark that it told last."
  @type t :: %__MODULE__{
          streaks: Streaks.t(),
          at_ms: integer() | nil,
          own: %{Vision.Mark.id() => seen()},
          told: %{Vision.Mark.id() => %{atom() => seen()}},
          known: %{Vision.Mark.id() => seen()},
          last: Vision.Mark.id() | nil
        }

  @doc "The fields of the message by which a robot tells of a mark."
  @spec table() :: Hal.Options.table()
  def table do
    mm = {:integer, -@far_mm, @far_mm, "mm"}
    mm2 = {:integer, -@most_mm2, @most_mm2, "mm2"}
    angle = {:integer, -4_000, 4_000, "mrad"}

    [
      id: [{:integer, 0, 0xFFFF}, required: true],
      at: [{:tuple, [mm, mm], "{x, y} in mm"}, required: true],
      var: [{:tuple, [mm2, mm2, mm2], "{xx, xy, yy} in mm2"}, required: true],
      turn: [{:or, nil, {:tuple, [angle, angle], "{turn, sd} in mrad"}}, required: true]
    ]
  end

  @doc "Takes the marks that were read in the percept's picture."
  @spec look(t(), Percept.t()) :: t()
  def look(marks, %Percept{detections: nil}), do: marks
  def look(marks, %Percept{uncertainty: %{lost?: true}}), do: %{marks | streaks: %{}}
  def look(%{at_ms: at_ms} = marks, %Percept{detections: %{at_ms: at_ms}}), do: marks

  def look(marks, %Percept{detections: picture} = percept) do
    {read, streaks} = Streaks.note(marks.streaks, picture.marks, picture.at_ms)

    for mark <- read,
        place = MarkPlace.of(percept, mark),
        hangs?(place, percept),
        reduce: %{marks | streaks: streaks, at_ms: picture.at_ms} do
      marks ->
        own = put(marks.own, mark.id, {place, turn(percept, mark)})
        know(%{marks | own: own}, mark.id)
    end
  end

  defp hangs?({at, variances}, %{peers: peers}) do
    {worst, _least, _direction} = Anchors.spread(variances)

    worst <= @worst and
      not Enum.any?(peers, fn {_id, peer} ->
        Pose.distance(at, Pose.point(peer.pose)) < peer.radius + @borne
      end)
  end

  defp turn(_percept, %{yaw: nil}), do: nil

  defp turn(%{detections: %{pose: pose}, uncertainty: %{heading: heading}}, mark),
    do:
      {Pose.wrap(pose.heading + mark.yaw - :math.pi()),
       :math.sqrt(mark.yaw_sd * mark.yaw_sd + heading * heading)}

  defp put(own, id, seen) when is_map_key(own, id) or map_size(own) < @most,
    do: Map.update(own, id, seen, &join(&1, seen))

  defp put(own, _id, _one_too_many), do: own

  # What contradicts what it saw before is believed if it is surer: it has found its place since. Vaguer sightings take nothing from a good one.
  defp join({before, facing}, {now, turned} = seen) do
    case MarkPlace.fuse([before, now]) do
      nil -> if spread(now) < spread(before), do: seen, else: {before, facing}
      place -> {Enum.min_by([before, place], &spread/1), surest([facing, turned])}
    end
  end

  defp spread({_at, {xx, _xy, yy}}), do: xx + yy

  defp surest(turns),
    do: turns |> Enum.reject(&is_nil/1) |> Enum.min_by(&elem(&1, 1), fn -> nil end)

  @doc "What is to be told now: nothing, or one mark."
  @spec tell(t()) :: {keyword() | nil, t()}
  def tell(%__MODULE__{own: own} = marks) when own == %{}, do: {nil, marks}

  def tell(%__MODULE__{own: own, last: last} = marks) do
    ids = Enum.sort(Map.keys(own))
    id = Enum.find(ids, hd(ids), &(last != nil and &1 > last))
    {said(id, own[id]), %{marks | last: id}}
  end

  defp said(id, {{{x, y}, {xx, xy, yy}}, facing}) do
    squares =
      {clip(xx * 1.0e6, @most_mm2), clip(xy * 1.0e6, @most_mm2), clip(yy * 1.0e6, @most_mm2)}

    turn = with {turn, sd} <- facing, do: {clip(turn * 1_000, 4_000), clip(sd * 1_000, 4_000)}
    [id: id, at: {clip(x * 1_000, @far_mm), clip(y * 1_000, @far_mm)}, var: squares, turn: turn]
  end

  defp clip(number, most), do: number |> round() |> max(-most) |> min(most)

  @doc "Takes what another robot tells, checked by `table/0`; a covariance that is none is not heard."
  @spec hear(t(), atom(), map()) :: t()
  def hear(marks, from, %{id: id, at: {x, y}, var: {xx, xy, yy}, turn: turn}) do
    told = Map.get(marks.told, id, %{})

    if xx > 0 and yy > 0 and xx * yy > xy * xy and room?(marks.told, told, id, from) do
      facing = with {turn, sd} <- turn, do: {turn / 1_000, sd / 1_000}
      seen = {{{x / 1_000, y / 1_000}, {xx / 1.0e6, xy / 1.0e6, yy / 1.0e6}}, facing}
      know(%{marks | told: Map.put(marks.told, id, Map.put(told, from, seen))}, id)
    else
      marks
    end
  end

  defp room?(all, told, id, from),
    do:
      (is_map_key(all, id) or map_size(all) < @most) and
        (is_map_key(told, from) or map_size(told) < @most_robots)

  # What follows from all that was seen of it.
  defp know(%{own: own, told: told} = marks, id) do
    told = for {_robot, seen} <- Enum.sort(Map.get(told, id, %{})), do: seen
    {places, turns} = Enum.unzip(List.wrap(own[id]) ++ told)

    case MarkPlace.fuse(places) do
      nil -> %{marks | known: Map.delete(marks.known, id)}
      place -> %{marks | known: Map.put(marks.known, id, {place, surest(turns)})}
    end
  end

  @doc "All marks whose place is known, by what all have seen, in the order of their numbers."
  @spec known(t()) :: [{Vision.Mark.id(), seen()}]
  def known(%__MODULE__{known: known}), do: Enum.sort(known)

  @doc """
  Those for the description of a map, which says of each how it is turned, and how sure its place is: `{id, {x, y, turn, sd}}`, the greatest
  standard deviation.
  """
  @spec hung(t()) :: [{Vision.Mark.id(), {float(), float(), float(), sd :: float()}}]
  def hung(marks) do
    for {id, {{{x, y}, variances}, {turn, _sd}}} <- known(marks) do
      {worst, _least, _direction} = Anchors.spread(variances)
      {id, {x, y, turn, worst}}
    end
  end

  @doc "What is drawn of them (`t:Robot.Mission.layer/0`)."
  @spec layer(t()) :: Robot.Mission.layer()
  def layer(marks) do
    case known(marks) do
      [] -> []
      known -> [{:points, "marks", for({id, seen} <- known, do: point(id, seen))}]
    end
  end

  defp point(id, {{{x, y}, variances}, _turn}) do
    radius = variances |> Anchors.spread() |> Anchors.radius()
    {x, y, "mark #{id} ±#{:erlang.float_to_binary(radius, decimals: 2)} m"}
  end
end
