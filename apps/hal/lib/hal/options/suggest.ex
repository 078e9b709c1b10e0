defmodule Hal.Options.Suggest do
  @moduledoc "Suggests what an unknown word may have meant. Pure."

  @near_enough 0.77
  # Longer words (in bytes) are not compared: they are no typing errors, and comparing takes time.
  @longest 255

  @doc """
  The known word that is most like `word`, or `nil` if none is like it.

      iex> Hal.Options.Suggest.nearest("fromation", ["formation", "landmark"])
      "formation"
      iex> Hal.Options.Suggest.nearest("xyz", ["formation", "landmark"])
      nil
      iex> Hal.Options.Suggest.nearest(<<"format", 0xFF>>, ["formation", "landmark"])
      nil
  """
  @spec nearest(String.t(), [String.t()]) :: String.t() | nil
  def nearest(word, known) do
    # Newer Elixirs do not compare binaries that are not text, such as the words of a damaged
    # file.
    if byte_size(word) <= @longest and String.valid?(word),
      do: likest(String.downcase(word), known)
  end

  defp likest(word, known) do
    known
    |> Enum.map(&{String.jaro_distance(word, &1), &1})
    |> Enum.filter(fn {likeness, _known} -> likeness > @near_enough end)
    |> Enum.max_by(&elem(&1, 0), fn -> {0, nil} end)
    |> elem(1)
  end

  @doc """
  The hint to append to an error; empty if there is nothing to suggest. `known` holds words, or
  the values that `word` should have been one of.

      iex> Hal.Options.Suggest.hint("hal", ["hall", "arena"])
      "; did you mean hall?"
      iex> Hal.Options.Suggest.hint(":manaul", [nil, :manual, :auto])
      "; did you mean :manual?"
      iex> Hal.Options.Suggest.hint("moon", ["hall", "arena"])
      ""
  """
  @spec hint(String.t(), [term()]) :: String.t()
  def hint(word, known) do
    shown = Map.new(known, &{bare(to_string(&1)), if(is_binary(&1), do: &1, else: inspect(&1))})

    case nearest(bare(word), Enum.map(known, &bare(to_string(&1)))) do
      nil -> ""
      near -> "; did you mean #{shown[near]}?"
    end
  end

  # An atom and a text are compared by their letters.
  defp bare(word), do: word |> String.trim("\"") |> String.trim_leading(":")
end
