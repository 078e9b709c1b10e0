defmodule Console.Picture.Labels do
  @moduledoc "Places names and numbered stages on a run's picture so that they hide little. Pure."
  alias Console.Picture.{RunTrack, Svg}
  alias Console.Picture.Colours
  alias Hal.Pose

  @ink "#22262B"
  @halo [paint_order: "stroke", stroke: "#FFFFFF", stroke_width: 3, stroke_linejoin: "round"]

  @doc "All labels; `at` turns metres into pixels."
  @spec draw(RunTrack.t(), (Pose.point() -> {float(), float()}), float(), float()) :: iodata()
  def draw(track, at, scale, width) do
    marks = marks(track, at, scale)
    taken = for {_number, {x, y}} <- marks, do: {x - 9, y - 9, 18, 18}

    [
      names(track.last, at, scale, width, taken),
      for({number, {x, y}} <- marks, do: badge(number, x, y))
    ]
  end

  @doc "The badge of the stage with this number."
  @spec badge(pos_integer(), float(), float()) :: iodata()
  def badge(number, x, y) do
    [
      Svg.element(:circle, cx: x, cy: y, r: 8, fill: @ink, stroke: "#FFFFFF", stroke_width: 1.5),
      Svg.text("#{number}", x, y + 3.6,
        fill: "#FFFFFF",
        font_size: 10,
        font_weight: "bold",
        text_anchor: "middle"
      )
    ]
  end

  # Stages at one place would hide each other, so each stands beside the previous one.
  defp marks(track, at, scale) do
    track.marks
    |> Enum.reverse()
    |> Enum.with_index(1)
    |> Enum.reject(fn {{_stage, place}, _number} -> place == nil end)
    |> Enum.map_reduce([], fn {{_stage, place}, number}, taken ->
      {x, y} = at.(place)
      spot = free_spot({x, y - 0.35 * scale - 10}, taken)
      {{number, spot}, [spot | taken]}
    end)
    |> elem(0)
  end

  defp free_spot({x, y} = spot, taken) do
    if Enum.any?(taken, fn {tx, ty} -> abs(tx - x) < 17 and abs(ty - y) < 17 end),
      do: free_spot({x + 18, y}, taken),
      else: spot
  end

  defp names(scene, at, scale, width, taken) do
    # In a crowd the legend and the colours must suffice.
    if length(scene.robots) > 24 do
      []
    else
      scene.robots
      |> Enum.map_reduce(obstacles(scene, at, scale) ++ taken, fn robot, taken ->
        spot = robot |> spots(at, scale, width) |> Enum.min_by(&crowd(&1, taken))
        {name(robot, spot), [spot | taken]}
      end)
      |> elem(0)
    end
  end

  # The boxes where a name may stand: right, left, above or below its robot.
  defp spots(robot, at, scale, width) do
    {x, y} = at.(Pose.point(robot.pose))
    r = Colours.size(robot, scale) + 7
    wide = 34

    for {left, top} <- [
          {x + r, y - 6},
          {x - r - wide, y - 6},
          {x - wide / 2, y + r},
          {x - wide / 2, y - r - 12}
        ],
        left > 2 and left + wide < width,
        do: {left, top, wide, 12}
  end

  defp obstacles(scene, at, scale) do
    for robot <- scene.robots do
      {x, y} = at.(Pose.point(robot.pose))
      r = Colours.size(robot, scale) + 3
      {x - r, y - r, 2 * r, 2 * r}
    end
  end

  defp crowd({left, top, wide, high}, taken) do
    taken
    |> Enum.map(fn {l, t, w, h} ->
      max(0.0, min(left + wide, l + w) - max(left, l)) *
        max(0.0, min(top + high, t + h) - max(top, t))
    end)
    |> Enum.sum()
  end

  defp name(robot, {left, top, wide, _high}) do
    Svg.text(
      Atom.to_string(robot.id),
      left + wide / 2,
      top + 10,
      [
        font_size: 11,
        font_weight: if(robot.leader?, do: "bold", else: "normal"),
        fill: @ink,
        text_anchor: "middle"
      ] ++ @halo
    )
  end
end
