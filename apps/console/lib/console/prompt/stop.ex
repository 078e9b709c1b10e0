defmodule Console.Prompt.Stop do
  @moduledoc """
  Reads lines that mean a stop, however they are typed: a stop that is typed nearly right stops. Pure.

  What begins like an emergency stop is one, of all robots, whatever follows. What begins like `stop` or `disarm` is one of
  the robots that follow, or of all where only words such as `all` and `now` do.
  """
  alias Hal.Options.Suggest

  @emergency ~w(estop eestop halt emergency emergencystop)
  @first ~w(stop disarm)
  @filler ~w(all now please it them everybody everyone everything the robot robots fleet at once stop)

  @doc """
  The command of a line; `:other` for a line that means something else, or names a robot that is not there. `words` are
  the other words that a line may begin with: one that is more like these means these.

      iex> for line <- ["estop all", "e-stop", "E-STOP!!", "eestop", "emergency stop", "halt", "etsop", "mag1 estop now"],
      ...>     do: Console.Prompt.Stop.read(line, ["reset", "step", "mag1"], [:mag1])
      List.duplicate({:ok, :estop}, 8)
      iex> for line <- ["stop all", "stop!", "stpo", "all stop!", "stop mag1", "mag1 stop", "disarm now"],
      ...>     do: elem(Console.Prompt.Stop.read(line, ["reset", "step", "mag1"], [:mag1]), 1)
      [{:tell, :all, :stop}, {:tell, :all, :stop}, {:tell, :all, :stop}, {:tell, :all, :stop},
       {:tell, [:mag1], :stop}, {:tell, [:mag1], :stop}, {:tell, :all, :disarm}]
      iex> for line <- ["step", "start mag1", "stop mag9", "reset"],
      ...>     do: Console.Prompt.Stop.read(line, ["reset", "step", "start", "mag1"], [:mag1])
      List.duplicate(:other, 4)
  """
  @spec read(String.t(), words :: [String.t()], robots :: [atom()]) ::
          {:ok, :estop | {:tell, :all | [atom()], :stop | :disarm}} | :other
  def read(line, words, robots) do
    case line |> String.downcase() |> String.split(~r/[^\p{L}\p{N}_]+/u, trim: true) do
      [] -> :other
      said -> said(said, words, Map.new(robots, &{Atom.to_string(&1), &1}))
    end
  end

  defp said([first | rest] = said, words, robots) do
    cond do
      named?(first, robots) and rest != [] -> of(first, said(rest, words, robots), robots)
      emergency?(said) -> {:ok, :estop}
      true -> stop(kind(first, words), rest, robots)
    end
  end

  defp named?(word, robots), do: word == "all" or is_map_key(robots, word)

  # `mag1 stop`, `all stop now`
  defp of("all", stop, _robots), do: stop
  defp of(name, {:ok, {:tell, :all, word}}, robots), do: {:ok, {:tell, [robots[name]], word}}
  defp of(_name, stop, _robots), do: stop

  # `e stop` is what is left of `e-stop`.
  defp emergency?([first | _rest] = said) do
    joined = Enum.join(said)

    String.starts_with?(joined, ["estop", "eestop"]) or
      String.starts_with?(first, ["emergenc", "halt"])
  end

  defp kind(first, words) do
    case Suggest.nearest(first, @emergency ++ @first ++ (words -- @emergency)) do
      near when near in @emergency -> :estop
      "stop" -> :stop
      "disarm" -> :disarm
      _other -> :other
    end
  end

  defp stop(:estop, _rest, _robots), do: {:ok, :estop}
  defp stop(:other, _rest, _robots), do: :other

  defp stop(word, rest, robots) do
    names = Enum.reject(rest, &(&1 in @filler))

    cond do
      names == [] ->
        {:ok, {:tell, :all, word}}

      Enum.all?(names, &is_map_key(robots, &1)) ->
        {:ok, {:tell, Enum.map(names, &robots[&1]), word}}

      true ->
        :other
    end
  end
end
