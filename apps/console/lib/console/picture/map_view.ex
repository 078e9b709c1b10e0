defmodule Console.Picture.MapView do
  @moduledoc false
  # Holds a map for the views: its sides in metres, with the origin in the middle, and its walls; `unknown?` says which of
  # these are walls only because it is not known what is there (`nil`: none). Pure.

  @enforce_keys [:name, :width, :height, :wall?]
  defstruct @enforce_keys ++ [unknown?: nil]

  @type box :: {left :: float(), bottom :: float(), right :: float(), top :: float()}
  @type t :: %__MODULE__{
          name: String.t(),
          width: float(),
          height: float(),
          wall?: (float(), float() -> boolean()),
          unknown?: (float(), float() -> boolean()) | nil
        }

  @doc "What is at a point."
  @spec kind(t(), float(), float()) :: :floor | :wall | :unknown
  def kind(%__MODULE__{wall?: wall?, unknown?: unknown?}, x, y) do
    cond do
      not wall?.(x, y) -> :floor
      unknown? != nil and unknown?.(x, y) -> :unknown
      true -> :wall
    end
  end

  @doc """
  The whole map as a box.

      iex> room = %Console.Picture.MapView{name: "hall", width: 16.0, height: 12.0, wall?: fn _x, _y -> false end}
      iex> Console.Picture.MapView.box(room)
      {-8.0, -6.0, 8.0, 6.0}
  """
  @spec box(t()) :: box()
  def box(%__MODULE__{width: width, height: height}),
    do: {-width / 2, -height / 2, width / 2, height / 2}

  @doc """
  The box around some places with a margin, of at least the given width and height, kept within
  the map.

      iex> room = %Console.Picture.MapView{name: "hall", width: 16.0, height: 12.0, wall?: fn _x, _y -> false end}
      iex> Console.Picture.MapView.around(room, [{7.0, 0.0}], 1.0, {4.0, 4.0})
      {4.0, -2.0, 8.0, 2.0}
  """
  @spec around(t(), [{float(), float()}], float(), {float(), float()}) :: box()
  def around(ground, [], _margin, _least), do: box(ground)

  def around(ground, places, margin, {wide, high}) do
    {x0, x1} = places |> Enum.map(&elem(&1, 0)) |> Enum.min_max()
    {y0, y1} = places |> Enum.map(&elem(&1, 1)) |> Enum.min_max()
    {left, right} = span(x0 - margin, x1 + margin, wide, ground.width / 2)
    {bottom, top} = span(y0 - margin, y1 + margin, high, ground.height / 2)
    {left, bottom, right, top}
  end

  defp span(low, high, least, edge) do
    grow = max(0.0, least - (high - low)) / 2
    {low, high} = {low - grow, high + grow}

    # The box is shifted before it is cut, so that a fleet at a wall is still shown with its
    # surroundings.
    shift = max(0.0, -edge - low) - max(0.0, high - edge)
    {max(-edge, low + shift), min(edge, high + shift)}
  end
end
