defmodule Docs.Shown do
  @moduledoc """
  Whether an answer of a shell is what a page shows. Pure.

  Both are read as terms are written: text, and what stands in brackets with commas between it. A map's entries,
  and those of a struct, may come in any order, as releases of OTP print them in different ones; all else has its order.

    * `…` as an element after others stands for one at least
    * `…` as an entry of a map stands for one more entry at least, whatever its place
    * `…` alone in its brackets stands for anything, and for nothing
    * `…` within an element stands for any part of it: `25.…`, `"no robot…"`, `age: …`; at the end of the last one also for
      those that come, if any: `age 3 ms…`

  What has no such brackets, as their pairs do not match, is compared as text (`Docs.Reader.like?/2`).
  """
  alias Docs.Reader

  @typep element :: [integer() | {opening :: String.t(), [element()]}]

  @doc "Whether what was printed is what the page shows."
  @spec like?(String.t(), String.t()) :: boolean()
  def like?(shown, printed) do
    {plain_shown, plain_printed} = Reader.plain(shown, printed)

    with {:ok, wanted} <- read(plain_shown), {:ok, found} <- read(plain_printed) do
      elements?(wanted, found)
    else
      :error -> Reader.like?(shown, printed)
    end
  end

  @doc "The elements of a text; `:error` where a bracket has no partner."
  @spec read(String.t()) :: {:ok, [element()]} | :error
  def read(text) do
    with {:ok, elements, ""} <- elements(text, nil, [], []), do: {:ok, elements}
  end

  # Up to the bracket that closes, or to the end. Both lists have their last first.
  defp elements("", nil, element, before), do: {:ok, all(element, before), ""}
  defp elements("", _closing, _element, _before), do: :error

  defp elements("," <> rest, closing, element, before),
    do: elements(rest, closing, [], [Enum.reverse(element) | before])

  defp elements("\"" <> _ = text, closing, element, before) do
    [string] = Regex.run(~r/\A"(?:(?:[^"\\]|\\.)*")?/su, text)
    element = Enum.reverse(String.to_charlist(string), element)
    elements(String.replace_prefix(text, string, ""), closing, element, before)
  end

  defp elements(text, closing, element, before) do
    opening = opening(text)

    cond do
      closing != nil and String.starts_with?(text, closing) ->
        {:ok, all(element, before), String.replace_prefix(text, closing, "")}

      opening != nil ->
        inside = String.replace_prefix(text, opening, "")

        with {:ok, elements, rest} <- elements(inside, partner(opening), [], []),
             do: elements(rest, closing, [{opening, elements} | element], before)

      text =~ ~r/\A[\]})]/ ->
        :error

      true ->
        <<char::utf8, rest::binary>> = text
        elements(rest, closing, [char | element], before)
    end
  end

  defp all([], []), do: []
  defp all(element, before), do: Enum.reverse([Enum.reverse(element) | before])

  defp opening(text) do
    with [opening] <- Regex.run(~r/\A(?:%[\w.]*\{|<<|[\[{(])/u, text), do: opening
  end

  defp partner("["), do: "]"
  defp partner("("), do: ")"
  defp partner("<<"), do: ">>"
  defp partner(_brace), do: "}"

  defp elements?([[?…]], _any), do: true
  defp elements?(wanted, found), do: ordered?(wanted, found)

  defp ordered?([], []), do: true

  defp ordered?([[?…] | wanted] = open, [_ | found]),
    do: ordered?(wanted, found) or ordered?(open, found)

  defp ordered?([first | wanted], [one | found]) do
    more? = wanted == [] and match?([_, _ | _], first) and List.last(first) == ?…
    parts?(first, one) and (more? or ordered?(wanted, found))
  end

  defp ordered?(_wanted, _found), do: false

  # Each entry that the page shows is one that was printed, and none is taken twice.
  defp entries?([[?…]], _any), do: true

  defp entries?(wanted, found) do
    {open, wanted} = Enum.split_with(wanted, &(&1 == [?…]))
    more = length(found) - length(wanted)
    fits? = if open == [], do: more == 0, else: more > 0
    fits? and each?(wanted, found)
  end

  defp each?([], _left), do: true

  defp each?([first | wanted], found) do
    Enum.any?(found, &(parts?(first, &1) and each?(wanted, List.delete(found, &1))))
  end

  defp parts?([], []), do: true
  defp parts?([?…], _any), do: true
  defp parts?([?… | wanted], []), do: parts?(wanted, [])

  defp parts?([?… | rest] = wanted, [_ | more] = found),
    do: parts?(rest, found) or parts?(wanted, more)

  defp parts?([{"%" <> _ = opening, wanted} | rest], [{opening, found} | more]),
    do: entries?(wanted, found) and parts?(rest, more)

  defp parts?([{opening, wanted} | rest], [{opening, found} | more]),
    do: elements?(wanted, found) and parts?(rest, more)

  defp parts?([char | wanted], [char | found]) when is_integer(char), do: parts?(wanted, found)
  defp parts?(_wanted, _found), do: false
end
