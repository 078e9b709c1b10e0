defmodule Sim.Floorplan.Drawing do
  @moduledoc "Draws a map from shapes, with cells of 5 cm. Pure."
  alias Sim.Compute
  alias Sim.Floorplan.Shape

  @cell 0.05

  @doc "The length of a cell's side in metres."
  @spec cell() :: float()
  def cell, do: @cell

  @doc """
  The fields of a map of this name and size in metres, with its shapes. Later shapes cover earlier
  ones; where there is none, it is `ground`. The centre of a cell decides what it is. `room` is
  where a fleet starts.
  """
  @spec plan(
          String.t(),
          {float(), float()},
          Sim.Floorplan.rectangle(),
          [Shape.t()],
          :free | :wall
        ) ::
          map()
  def plan(name, {width, height}, room, shapes, ground \\ :free) do
    {w, h} = {round(width / @cell), round(height / @cell)}

    {rows, _drawn} =
      Enum.map_reduce(0..(h - 1), %{}, fn j, drawn ->
        y = (j + 0.5 - h / 2) * @cell
        spans = for {ink, outline} <- shapes, span = Shape.span(outline, y), do: {ink, span}
        # Rows that are crossed by the same shapes in the same way are drawn once.
        drawn = Map.put_new_lazy(drawn, spans, fn -> row(spans, w, ground) end)
        {drawn[spans], drawn}
      end)

    field = rows |> IO.iodata_to_binary() |> Compute.field(w, h)
    %{name: name, width: w, height: h, cell: @cell, field: field, room: room}
  end

  defp row(spans, w, ground) do
    spans = Enum.reverse(spans)

    for i <- 0..(w - 1), x = (i + 0.5 - w / 2) * @cell, into: <<>> do
      case Enum.find(spans, fn {_ink, {left, right}} -> x >= left and x < right end) do
        {ink, _span} -> byte(ink)
        nil -> byte(ground)
      end
    end
  end

  defp byte(:wall), do: <<1>>
  defp byte(:free), do: <<0>>
end
