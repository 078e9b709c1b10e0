defmodule Console.Picture.Colours do
  @moduledoc false
  # Chooses the colour and size of each robot in a drawing; the colours are distinguishable for the colour-blind. Pure.
  #
  # The first seven are Okabe and Ito's; larger fleets repeat them with other dash patterns.

  @colours ["#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#5B3A8C"]
  @dashes [nil, "7 3", "2 3", "9 3 2 3", "14 4", "4 2 1 2"]

  @doc """
  Colour and dash pattern of the robot at an index.

      iex> Console.Picture.Colours.at(0)
      {"#0072B2", nil}
      iex> Console.Picture.Colours.at(7)
      {"#0072B2", "7 3"}
  """
  @spec at(non_neg_integer()) :: {String.t(), String.t() | nil}
  def at(index) do
    count = length(@colours)
    dash = Enum.at(@dashes, rem(div(index, count), length(@dashes)))
    {Enum.at(@colours, rem(index, count)), dash}
  end

  @doc """
  The radius a robot is drawn with, in pixels: to scale, but never too small to be seen.

      iex> {Console.Picture.Colours.size(%{radius: 0.2}, 50.0), Console.Picture.Colours.size(%{radius: 0.2}, 5.0)}
      {10.0, 4.0}
  """
  @spec size(%{:radius => float(), optional(atom()) => term()}, float()) :: float()
  def size(robot, scale), do: max(robot.radius * scale, 4.0)
end
