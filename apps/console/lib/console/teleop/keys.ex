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

  @arrows %{"A" => "w", "B" => "s", "C" => "d", "D" => "a"}
  # After `\e[`, up to the letter or `~` that ends it; the second bracket is of the Linux console's F1 to F5.
  @parameters Enum.map(?0..??, &<<&1>>) ++ ["["]

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
  def key(keys, "\e"), do: {nil, %{keys | escape: "\e"}}

  def key(%{escape: "\e"} = keys, char) when char in ["[", "O"],
    do: {nil, %{keys | escape: "\e" <> char}}

  # Escape was a key of its own. What stops is heard in the middle of a sequence, too: none has it.
  def key(%{escape: escape} = keys, char)
      when escape in ["", "\e"] or char <= " " or char == "e",
      do: said(keys, char)

  def key(%{escape: escape} = keys, char) do
    cond do
      escape in ["\e[", "\eO"] and is_map_key(@arrows, char) -> said(keys, @arrows[char])
      # Parameters: another key, or an arrow with a modifier.
      escape != "\eO" and char in @parameters -> {nil, %{keys | escape: longer(escape, char)}}
      char == "~" and escape =~ ~r/^\e\[19(;|$)/ -> said(keys, "e")
      # The end of another key: F4 ends with S, Ctrl and left with D.
      true -> {nil, %{keys | escape: ""}}
    end
  end

  # No key has more.
  defp longer(escape, char), do: if(byte_size(escape) < 16, do: escape <> char, else: escape)

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
