defmodule Tools.Replay.Command do
  @moduledoc "Reads what a person types in `mix replay FILE --step`. Pure."
  alias Hal.Cli.{Arguments, Parse}
  alias Tools.Replay.Asked
  alias Hal.Options.Suggest

  @words ~w(step back goto next previous show why help quit)
  @most 1_000_000

  @typedoc "`:again` is an empty line; times are in ms, names `nil` where none was given."
  @type t ::
          :again
          | {:step, integer()}
          | {:goto, non_neg_integer()}
          | :next
          | :previous
          | {:show | :why, name :: String.t() | nil}
          | :help
          | :quit

  @doc """
  The command in a line, for a run with robots of these names that takes so many seconds; the error
  is one line.

      iex> Tools.Replay.Command.parse("back 3", ["mag1"], 25.0)
      {:ok, {:step, -3}}
      iex> Tools.Replay.Command.parse("g 12.5", ["mag1"], 25.0)
      {:ok, {:goto, 12_500}}
      iex> Tools.Replay.Command.parse("stepp", ["mag1"], 25.0)
      {:error, ~s("stepp" is not known; did you mean step?)}
      iex> Tools.Replay.Command.parse("goto 30", ["mag1"], 25.0)
      {:error, ~s(goto: expected a number from 0 to 25.0, got "30")}
  """
  @spec parse(String.t(), [String.t()], float()) :: {:ok, t()} | {:error, line :: String.t()}
  def parse(line, names, last_s) do
    case String.split(line) do
      [] -> {:ok, :again}
      [word | rest] -> word |> whole() |> command(rest, names, last_s)
    end
  end

  @doc "What can be typed, line by line."
  @spec help() :: [String.t()]
  def help do
    [
      "step, step 10     one tick of 0.1 s on, or ten; Enter does the last one again",
      "back, back 10     the same backwards",
      "goto 42.3         to this second",
      "next, previous    to the next event of the fleet, or to the one before",
      "show, show mag1   how the fleet stands here, or one robot",
      "why, why mag1     why the leader did what it did at this tick, or another robot",
      "help, quit        also Ctrl-D; the first letter of a word is enough"
    ]
  end

  defp whole("?"), do: "help"

  defp whole(<<_letter>> = word),
    do: Enum.find(@words, word, &String.starts_with?(&1, word))

  defp whole(word), do: word

  defp command("step", rest, _names, _last_s), do: ticks("step", rest, 1)
  defp command("back", rest, _names, _last_s), do: ticks("back", rest, -1)

  defp command("goto", [text], _names, last_s) do
    case Parse.number(text, 0, last_s) do
      {:ok, at_s} -> {:ok, {:goto, round(1000 * at_s)}}
      {:error, allowed} -> Arguments.refuse("goto", text, allowed)
    end
  end

  defp command("goto", _none_or_more, _names, _last_s),
    do: {:error, "goto needs one time in seconds: goto 42.3"}

  defp command("show", rest, names, _last_s), do: named(:show, rest, names)
  defp command("why", rest, names, _last_s), do: named(:why, rest, ["leader" | names])
  defp command("next", [], _names, _last_s), do: {:ok, :next}
  defp command("previous", [], _names, _last_s), do: {:ok, :previous}
  defp command("help", _rest, _names, _last_s), do: {:ok, :help}
  defp command("quit", _rest, _names, _last_s), do: {:ok, :quit}

  defp command(word, _rest, _names, _last_s) when word in @words,
    do: {:error, "#{word} takes nothing more"}

  defp command(word, _rest, _names, _last_s),
    do: {:error, "#{inspect(word)} is not known" <> hint(word)}

  defp hint(word) do
    case Suggest.hint(word, @words) do
      "" -> "; help lists the commands"
      hint -> hint
    end
  end

  defp ticks(_word, [], sign), do: {:ok, {:step, sign}}

  defp ticks(word, [text], sign) do
    case Parse.whole(text, 1..@most) do
      {:ok, count} -> {:ok, {:step, sign * count}}
      {:error, allowed} -> Arguments.refuse(word, text, allowed)
    end
  end

  defp ticks(word, _more, _sign),
    do: {:error, "#{word} takes one number of ticks at most: #{word} 10"}

  defp named(what, [], _names), do: {:ok, {what, nil}}

  defp named(what, [name], names),
    do: with(:ok <- Asked.name(what, name, names), do: {:ok, {what, name}})

  defp named(what, _more, _names), do: {:error, "#{what} takes one name at most"}
end
