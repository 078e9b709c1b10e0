defmodule Bench.Marks.Runner do
  @moduledoc "Searches the pictures of `mix bench marks`, each kind on one processor, and counts."
  alias Bench.{Marks, Table}
  alias Bench.Marks.Rooms
  alias Sim.World
  alias Vision.Mark
  alias Vision.Marks.Schedule

  @bands [{0, 20}, {20, 40}, {40, 60}, {60, 1_000}]

  @typedoc """
  What became of a mark in a picture, how wide it is there, how wrong its reading is, and how long the search took, of the whole
  picture and of the surroundings of what was seen.
  """
  @type seen :: %{
          what: :right | :none | :wrong,
          width: float(),
          whole_us: non_neg_integer(),
          boxes_us: non_neg_integer(),
          errors: {{float(), float()}, {float(), float()}, {float(), float()} | nil} | nil
        }

  @doc "For each width the shares of pictures in which the right mark is found and no other, by condition."
  @spec found(Mark.family(), pos_integer(), integer(), (String.t() -> :ok)) ::
          [{pos_integer(), [float()]}]
  def found(family, pictures, seed, note) do
    {marks, detector} = detector(family)

    for width <- Marks.widths(family) do
      note.("#{width} pixels")
      random = :rand.seed_s(:exsss, {seed, width, 0})

      {hits, _random} =
        Enum.flat_map_reduce(1..pictures, random, fn _n, random ->
          {picture, id, random} = Marks.draw(family, width, random)

          Enum.map_reduce(Marks.conditions(), random, fn {condition, _says}, random ->
            {frame, random} = Marks.spoil(picture, condition, random)
            {:ok, seen} = Vision.Marks.find(marks, detector, frame)
            {{condition, Enum.map(seen, & &1.id) == [id]}, random}
          end)
        end)

      shares =
        for {condition, _says} <- Marks.conditions(),
            do: Enum.count(hits, &(&1 == {condition, true})) / pictures

      {width, shares}
    end
  end

  @doc "How many marks are seen where there is none: every other picture has squares that look like some."
  @spec empty(Mark.family(), pos_integer(), [String.t()], integer()) :: non_neg_integer()
  def empty(family, pictures, maps, seed) do
    {marks, detector} = detector(family)

    pictures
    |> each(maps, seed, fn world, n, random ->
      {world, random} =
        if rem(n, 2) == 0, do: Rooms.empty(world, random), else: Rooms.cluttered(world, random)

      {:ok, seen} = Vision.Marks.find(marks, detector, World.frame(world, :mag1))
      {world, length(seen), random}
    end)
    |> Enum.sum()
  end

  @doc "What becomes of one mark in each picture. Walls may hide it: such pictures count as those without."
  @spec tagged(Mark.family(), pos_integer(), [String.t()], integer()) :: [seen()]
  def tagged(family, pictures, maps, seed) do
    {marks, detector} = detector(family)

    each(pictures, maps, seed, fn world, _n, random ->
      {world, hung, random} = Rooms.marked(world, family, random)
      frame = World.frame(world, :mag1)
      look = &Vision.Marks.look(marks, detector, &1, &2)
      {whole_us, {:ok, seen, schedule}} = :timer.tc(fn -> look.(%Schedule{}, frame) end)
      # The next picture: only where the mark was.
      next = %{frame | at_ms: frame.at_ms + 100}
      {boxes_us, _again} = :timer.tc(fn -> look.(schedule, next) end)
      times = %{whole_us: whole_us, boxes_us: boxes_us}
      {world, Map.merge(judge(seen, hung, frame), times), random}
    end)
  end

  defp each(pictures, maps, seed, look) do
    for {map, k} <- Enum.with_index(maps), reduce: [] do
      done ->
        world = Rooms.world(map, seed)
        random = :rand.seed_s(:exsss, {seed, k, 1})
        count = div(pictures * (k + 1), length(maps)) - div(pictures * k, length(maps))

        {results, _end} =
          Enum.map_reduce(1..count//1, {world, random}, fn n, {world, random} ->
            {world, result, random} = look.(world, n, random)
            {result, {world, random}}
          end)

        done ++ results
    end
  end

  defp judge(seen, hung, frame) do
    width = frame.width / 2 / :math.tan(frame.field_of_view / 2) * Rooms.size() / hung.range

    case Enum.split_with(seen, &(&1.id == hung.id)) do
      {[mark], []} -> %{what: :right, width: width, errors: errors(mark, hung)}
      {[], []} -> %{what: :none, width: width, errors: nil}
      _others -> %{what: :wrong, width: width, errors: nil}
    end
  end

  # Each with how many deviations it is.
  defp errors(mark, hung) do
    {range, bearing} = {abs(mark.range - hung.range), abs(mark.bearing - hung.bearing)}

    yaw =
      if mark.yaw do
        off = abs(Hal.Pose.wrap(mark.yaw - hung.yaw))
        {off, off / mark.yaw_sd}
      end

    {{range / hung.range, range / mark.range_sd}, {bearing, bearing / mark.bearing_sd}, yaw}
  end

  @doc """
  How long searches took: median and 95 % in milliseconds.

      iex> Bench.Marks.Runner.times([%{what: :right, whole_us: 8_000, boxes_us: 900}])
      "8.0 / 8.0 ms, 0.9 / 0.9 ms of the surroundings of a mark"
  """
  @spec times([seen()]) :: String.t()
  def times(seen) do
    right = Enum.filter(seen, &(&1.what == :right))
    "#{ms(seen, :whole_us)} ms, #{ms(right, :boxes_us)} ms of the surroundings of a mark"
  end

  defp ms(seen, key) do
    values = Enum.map(seen, & &1[key])

    Enum.map_join([0.5, 0.95], " / ", fn share ->
      :erlang.float_to_binary(Table.quantile(values, share) / 1000, decimals: 1)
    end)
  end

  @doc "The rows of errors by how wide the mark is."
  @spec errors([seen()]) :: [[String.t()]]
  def errors(seen) do
    for {least, most} <- @bands,
        all = Enum.filter(seen, &(&1.width >= least and &1.width < most)),
        all != [] do
      right = for %{errors: {_, _, _} = errors} <- all, do: errors

      [ranges, bearings, yaws] =
        for k <- 0..2, do: right |> Enum.map(&elem(&1, k)) |> Enum.filter(& &1)

      [
        if(most == 1_000, do: "#{least} and more", else: "#{least} to #{most}"),
        "#{length(all)}",
        "#{length(right)}",
        figures(ranges, 100, " %"),
        figures(bearings, 180 / :math.pi(), ""),
        "#{length(yaws)}",
        figures(yaws, 180 / :math.pi(), ""),
        Enum.map_join([ranges, bearings, yaws], ", ", &within/1)
      ]
    end
  end

  defp figures([], _unit, _sign), do: "-"

  defp figures(errors, unit, sign) do
    values = Enum.map(errors, &elem(&1, 0))

    Enum.map_join([0.5, 0.95], " / ", fn share ->
      :erlang.float_to_binary(unit * Table.quantile(values, share), decimals: 2) <> sign
    end)
  end

  defp within([]), do: "-"
  defp within(all), do: "#{round(100 * Enum.count(all, &(elem(&1, 1) <= 2)) / length(all))} %"

  defp detector(family) do
    {:ok, marks} = Vision.Marks.new(family: family, size: Rooms.size())
    {:ok, detector} = Vision.Marks.detector(marks)
    {marks, detector}
  end
end
