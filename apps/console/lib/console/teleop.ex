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

  @most 1.0

  @doc """
  A word of the page's keys: the robot, its speed ahead and its turn to the left, as parts of the greatest (-1 to 1).

      iex> Console.Teleop.word("drive mag1 1 -0.5", [:mag1])
      {:ok, :mag1, {1.0, -0.5}}
      iex> Console.Teleop.word("drive mag1 9 x", [:mag1])
      {:error, "drive needs a robot and two numbers from -1 to 1: drive mag1 0.5 0"}
      iex> Console.Teleop.word("stop", [:mag1])
      :other
  """
  @spec word(String.t(), [atom()]) :: {:ok, atom(), stick()} | {:error, String.t()} | :other
  def word("drive" <> rest, robots) do
    with [name, ahead, turn] <- String.split(rest),
         robot when robot != nil <- Enum.find(robots, &(Atom.to_string(&1) == name)),
         {ahead, ""} when abs(ahead) <= @most <- Float.parse(ahead),
         {turn, ""} when abs(turn) <= @most <- Float.parse(turn) do
      {:ok, robot, {ahead, turn}}
    else
      _wrong -> {:error, "drive needs a robot and two numbers from -1 to 1: drive mag1 0.5 0"}
    end
  end

  def word(_line, _robots), do: :other

  @doc "How long a word lasts, in ms."
  @spec word_ms(:page | :gamepad | :terminal) :: pos_integer()
  def word_ms(:terminal), do: 500
  def word_ms(_tells_when_it_ends), do: 300

  @doc """
  The order of a word that was said so long ago, for `c:Console.Live.command/2`; it ends when the word does.

      iex> Console.Teleop.order(:mag1, {1.0, -0.5}, :page)
      {:tell, [:mag1], {:move, 0.5, -0.5, 0.3}}
      iex> Console.Teleop.order(:mag1, {1.0, -0.5}, :page, 100)
      {:tell, [:mag1], {:move, 0.5, -0.5, 0.2}}
  """
  @spec order(atom(), stick(), :page | :gamepad | :terminal, age_ms :: non_neg_integer()) ::
          Console.Live.command()
  def order(robot, {ahead, left}, by, age_ms \\ 0) do
    for_s = max(word_ms(by) - age_ms, 0) / 1_000
    {:tell, [robot], {:move, ahead * @speed, left * @turn, for_s}}
  end
end
