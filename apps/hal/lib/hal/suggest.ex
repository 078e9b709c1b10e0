defmodule Hal.Suggest do
  @moduledoc "What somebody may have meant by a word that nobody knows. Pure."

  @near_enough 0.77

  @doc """
  The known word most like `word`, or `nil` when none is like it.

      iex> Hal.Suggest.nearest("fromation", ["formation", "landmark"])
      "formation"
      iex> Hal.Suggest.nearest("xyz", ["formation", "landmark"])
      nil
      iex> Hal.Suggest.nearest(<<"format", 0xFF>>, ["formation", "landmark"])
      nil
  """
  @spec nearest(String.t(), [String.t()]) :: String.t() | nil
  def nearest(word, known) do
    # Newer Elixirs do not compare what is not text, such as the words of a damaged file.
    if String.valid?(word), do: likest(String.downcase(word), known)
  end

  defp likest(word, known) do
    known
    |> Enum.map(&{String.jaro_distance(word, &1), &1})
    |> Enum.filter(fn {likeness, _known} -> likeness > @near_enough end)
    |> Enum.max_by(&elem(&1, 0), fn -> {0, nil} end)
    |> elem(1)
  end

  @doc """
  The half-sentence to put behind an error, empty when there is nothing to suggest.

      iex> Hal.Suggest.hint("hal", ["hall", "arena"])
      ~s(; did you mean "hall"?)
      iex> Hal.Suggest.hint("moon", ["hall", "arena"])
      ""
  """
  @spec hint(String.t(), [String.t()]) :: String.t()
  def hint(word, known) do
    case nearest(word, known) do
      nil -> ""
      near -> "; did you mean #{inspect(near)}?"
    end
  end
end
