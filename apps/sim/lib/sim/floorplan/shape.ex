defmodule Sim.Floorplan.Shape do
  @moduledoc """
  Describes the shapes that the built-in maps are drawn with, and the part of a row that each covers. Pure. Only
  additions, multiplications, divisions and square roots, so that a map is the same on every machine.
  """

  @typedoc """
  Wall, or floor where there was wall; lengths are metres. A line has a thickness and flat ends.
  """
  @type t :: {:wall | :free, outline()}
  @type outline ::
          {:box, left :: float(), low :: float(), right :: float(), high :: float()}
          | {:disc, x :: float(), y :: float(), radius :: float()}
          | {:line, from :: {float(), float()}, to :: {float(), float()}, thickness :: float()}

  @doc """
  From where to where, along x, the shape covers the row at `y`; `nil` if it does not cross it.

      iex> Sim.Floorplan.Shape.span({:box, -1.0, 0.0, 2.0, 1.0}, 0.5)
      {-1.0, 2.0}
      iex> Sim.Floorplan.Shape.span({:disc, 0.0, 0.0, 2.0}, 3.0)
      nil
      iex> Sim.Floorplan.Shape.span({:line, {0.0, 0.0}, {0.0, 4.0}, 0.5}, 1.0)
      {-0.25, 0.25}
  """
  @spec span(outline(), float()) :: {left :: float(), right :: float()} | nil
  def span({:box, left, low, right, high}, y), do: if(y >= low and y < high, do: {left, right})

  def span({:disc, x, middle, radius}, y) do
    rest = radius * radius - (y - middle) * (y - middle)
    if rest > 0.0, do: {x - :math.sqrt(rest), x + :math.sqrt(rest)}
  end

  def span({:line, {ax, ay}, {bx, by}, thickness}, y) do
    length = :math.sqrt((bx - ax) * (bx - ax) + (by - ay) * (by - ay))
    {nx, ny} = {(ay - by) / length * thickness / 2, (bx - ax) / length * thickness / 2}
    corners = [{ax + nx, ay + ny}, {bx + nx, by + ny}, {bx - nx, by - ny}, {ax - nx, ay - ny}]

    case Enum.flat_map(Enum.zip(corners, tl(corners) ++ [hd(corners)]), &crossing(&1, y)) do
      [] -> nil
      places -> {Enum.min(places), Enum.max(places)}
    end
  end

  # Each corner belongs to the edge above it only, so that a row crosses two edges or none.
  defp crossing({{ax, ay}, {bx, by}}, y) do
    if (ay <= y and y < by) or (by <= y and y < ay),
      do: [ax + (y - ay) * (bx - ax) / (by - ay)],
      else: []
  end

  @doc "Four walls, so thick, whose outer edges are this far from the centre."
  @spec frame(float(), float(), float()) :: [t()]
  def frame(x, y, thick) do
    [
      {:wall, {:box, -x, -y, x, thick - y}},
      {:wall, {:box, -x, y - thick, x, y}},
      {:wall, {:box, -x, -y, thick - x, y}},
      {:wall, {:box, x - thick, -y, x, y}}
    ]
  end

  @doc "The same shape on the other side of the x axis."
  @spec below(t()) :: t()
  def below({ink, {:box, left, low, right, high}}), do: {ink, {:box, left, -high, right, -low}}
  def below({ink, {:disc, x, y, radius}}), do: {ink, {:disc, x, -y, radius}}
  def below({ink, {:line, {ax, ay}, {bx, by}, t}}), do: {ink, {:line, {ax, -ay}, {bx, -by}, t}}

  @doc "The same shape on the other side of the y axis."
  @spec beside(t()) :: t()
  def beside({ink, {:box, left, low, right, high}}), do: {ink, {:box, -right, low, -left, high}}
  def beside({ink, {:disc, x, y, radius}}), do: {ink, {:disc, -x, y, radius}}
  def beside({ink, {:line, {ax, ay}, {bx, by}, t}}), do: {ink, {:line, {-ax, ay}, {-bx, by}, t}}
end
