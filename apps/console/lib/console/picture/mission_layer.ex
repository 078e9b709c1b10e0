defmodule Console.Picture.MissionLayer do
  @moduledoc false
  # Draws on the floor of a picture what a mission has to do (`t:Robot.Mission.layer/0`). Pure.
  alias Console.Picture.Svg
  alias Hal.Pose

  @soft "#5B616B"

  @doc "One of its lines, points with labels, or cells; `at` is where a place of the map is, in pixels."
  @spec draw(tuple(), (Pose.point() -> {float(), float()})) :: iodata()
  def draw({:polyline, _name, points}, at) do
    look = [fill: "none", stroke: @soft, stroke_width: 1.2, stroke_dasharray: "6 4"]
    Svg.element(:polyline, [points: points |> Enum.map(at) |> Svg.points()] ++ look)
  end

  def draw({:cells, _name, size, places}, at) do
    {{left, _}, {right, _}} = {at.({0.0, 0.0}), at.({size, 0.0})}
    look = [width: right - left, height: right - left, fill: @soft, fill_opacity: 0.08]

    for {x, y} <- places,
        {px, py} = at.({x - size / 2, y + size / 2}),
        do: Svg.element(:rect, [x: px, y: py] ++ look)
  end

  def draw({:points, _name, points}, at) do
    look = [r: 3.5, fill: "none", stroke: @soft, stroke_width: 1.2]

    for {x, y, label} <- points, {px, py} = at.({x, y}) do
      said = Svg.text(label, px + 7, py + 4, font_size: 10, fill: @soft)
      [Svg.element(:circle, [cx: px, cy: py] ++ look), said]
    end
  end
end
