defmodule Console.Teleop do
  @moduledoc """
  Turns what a hand does on keyboards (terminal and page) and gamepads into orders to move. Pure.

  The dead man's switch is the robot's own: each word is an order for 300 ms, or for 500 ms by the keys of a terminal, which
  tell that a key is down only by repeating it. Whatever is gone then, the hand, the window, its program or the network, the robot
  stands.
  """

  # Half a metre a second and a radian a second are the hand's own limits; the robot has others.
  @speed 0.5
  @turn 1.0

  @typedoc "How far ahead and to the left, as parts of the greatest speed and turn (-1 to 1)."
  @type stick :: {ahead :: float(), left :: float()}

  @doc "How long a word lasts, in ms."
  @spec word_ms(:page | :gamepad | :terminal) :: pos_integer()
  def word_ms(:terminal), do: 500
  def word_ms(_tells_when_it_ends), do: 300

  @doc """
  The order of a word, for `c:Console.Live.command/2`.

      iex> Console.Teleop.order(:mag1, {1.0, -0.5}, :page)
      {:tell, [:mag1], "move:0.5:-0.5:0.3"}
  """
  @spec order(atom(), stick(), :page | :gamepad | :terminal) :: Console.Live.command()
  def order(robot, {ahead, left}, by),
    do: {:tell, [robot], "move:#{ahead * @speed}:#{left * @turn}:#{word_ms(by) / 1_000}"}
end
