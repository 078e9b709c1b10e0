defmodule Console.Teleop.Keys do
  @moduledoc """
  Reads the keys of a terminal that drives a robot, one character at a time. Pure.

  | key | |
  |---|---|
  | `w`, up | ahead |
  | `s`, down | back |
  | `a`, left; `d`, right | turns |
  | `+`, `-` | faster, slower |
  | space | stands |
  | `e`, F8 | emergency stop of all robots |
  | `q`, Enter, Ctrl-C | drives no more |
  """

  # The share of the greatest speed, and by what a key changes it.
  @first 0.6
  @step 0.2

  @enforce_keys [:robot]
  defstruct @enforce_keys ++ [share: @first, escape: ""]

  @type t :: %__MODULE__{robot: atom(), share: float(), escape: String.t()}

  @doc "Drives this robot."
  @spec new(atom()) :: t()
  def new(robot), do: %__MODULE__{robot: robot}

  @doc "How it goes, in a line."
  @spec hint(t()) :: String.t()
  def hint(%__MODULE__{robot: robot, share: share}),
    do:
      "driving #{robot} at #{round(share * 100)} %: w s a d or arrows, + and -, space stands, e stops ALL, q ends"

  @doc """
  What a character says: a word for the robot, another speed, the end, or nothing yet (arrows are three characters).

      iex> keys = Console.Teleop.Keys.new(:mag1)
      iex> {word, _keys} = Console.Teleop.Keys.key(keys, "w")
      iex> word
      {:word, {0.6, 0.0}}
      iex> {nil, keys} = Console.Teleop.Keys.key(keys, "\\e")
      iex> {nil, keys} = Console.Teleop.Keys.key(keys, "[")
      iex> {word, _keys} = Console.Teleop.Keys.key(keys, "D")
      iex> word
      {:word, {0.0, 0.6}}
  """
  @spec key(t(), String.t()) ::
          {nil | {:word, Console.Teleop.stick()} | :speed | :estop | :leave, t()}
  def key(%{escape: escape} = keys, char)
      when (escape <> char) in ["\e", "\e[", "\eO", "\e[1", "\e[19"],
      do: {nil, %{keys | escape: escape <> char}}

  def key(%{escape: ""} = keys, char), do: said(keys, char)
  def key(%{escape: "\e[19"} = keys, "~"), do: said(keys, "e")
  def key(keys, "A"), do: said(keys, "w")
  def key(keys, "B"), do: said(keys, "s")
  def key(keys, "C"), do: said(keys, "d")
  def key(keys, "D"), do: said(keys, "a")
  # Escape was a key of its own.
  def key(keys, char), do: said(keys, char)

  defp said(%{share: share} = keys, char) do
    keys = %{keys | escape: ""}

    case String.downcase(char) do
      "w" -> {{:word, {share, 0.0}}, keys}
      "s" -> {{:word, {-share, 0.0}}, keys}
      "a" -> {{:word, {0.0, share}}, keys}
      "d" -> {{:word, {0.0, -share}}, keys}
      " " -> {{:word, {0.0, 0.0}}, keys}
      "e" -> {:estop, keys}
      "+" -> {:speed, %{keys | share: min(share + @step, 1.0)}}
      "-" -> {:speed, %{keys | share: max(share - @step, @step)}}
      leave when leave in ["q", "\r", "\n", <<3>>, <<4>>] -> {:leave, keys}
      _other -> {nil, keys}
    end
  end
end
