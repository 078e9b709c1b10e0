defmodule Sim.Map.Drawing do
  @moduledoc "The maps that come along, drawn with cells of 5 cm. Pure."

  @cell 0.05

  @doc "The map of this name, grown until every shape of a fleet of this size fits round its centre."
  @spec draw(String.t(), pos_integer()) :: Sim.Map.t()
  def draw(_name, fleet) do
    # A column at 1 m spacing in any direction from the centre, and 3 m to drive round its end.
    half = fleet + 3.0
    hall(2 * max(8.0, half), 2 * max(6.0, half))
  end

  defp hall(width, height) do
    {w, h} = {round(width / @cell), round(height / @cell)}
    # Rows deeper inside than a byte can count, or than the hall is wide, are alike.
    rows = Map.new(1..255, fn most -> {most, row(w, most)} end)
    field = for j <- 0..(h - 1), into: <<>>, do: rows[Enum.min([j + 1, h - j, 255])]
    margin = {-width / 2, -height / 2, width / 2, height / 2}

    %Sim.Map{name: "hall", width: w, height: h, cell: @cell, field: field, room: margin}
  end

  defp row(w, most), do: for(i <- 0..(w - 1), into: <<>>, do: <<Enum.min([i + 1, w - i, most])>>)
end
