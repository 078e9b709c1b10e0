defmodule Robot.File.Edit do
  @moduledoc """
  Changes or adds numbers in the text of a robot file and nothing else: comments, order and layout
  stay as they are. Pure.
  """
  alias Robot.File.Reader

  @doc """
  The text with these numbers in its first list `conversions:`; keys that the list lacks are
  added. The caller should compare the parsed values of both texts before it writes the result.

      iex> Robot.File.Edit.conversions("[drive: {D, [conversions: [angle: 1.0, range: 2]]}]", angle: 3.5)
      {:ok, "[drive: {D, [conversions: [angle: 3.5, range: 2]]}]"}
      iex> Robot.File.Edit.conversions("[drive: {D, [conversions: []]}]", angle: 3.5)
      {:ok, "[drive: {D, [conversions: [angle: 3.5]]}]"}
      iex> Robot.File.Edit.conversions("[drive: {D, []}]", angle: 3.5)
      {:error, "there is no list conversions: [...] in it"}
  """
  @spec conversions(String.t(), keyword(number())) :: {:ok, String.t()} | {:error, String.t()}
  def conversions(text, numbers) do
    with {:ok, quoted} <- Reader.quoted(text), {_meta, items} = list <- find(quoted) do
      places =
        for {{:literal, _, {:name, key}}, value} <- items, into: %{}, do: {key, place(value)}

      {old, new} = Enum.split_with(numbers, fn {key, _} -> places["#{key}"] != nil end)
      changes = for {key, number} <- old, do: {places["#{key}"], "#{number}"}
      # Changes are applied from the end of the text, so that earlier places stay valid.
      changes = Enum.sort(changes ++ added(list, text, new), :desc)
      {:ok, Enum.reduce(changes, text, &change/2)}
    else
      nil -> {:error, "there is no list conversions: [...] in it"}
      {:error, {line, problem}} -> {:error, "line #{line}: #{problem}"}
    end
  end

  defp find({{:literal, _, {:name, "conversions"}}, {:literal, meta, items}}) when is_list(items),
    do: {meta, items}

  defp find(tuple) when is_tuple(tuple), do: tuple |> Tuple.to_list() |> find()
  defp find(list) when is_list(list), do: Enum.find_value(list, &find/1)
  defp find(_other), do: nil

  # The line of a number, its first column, and the column after it.
  defp place({:literal, meta, number}) when is_number(number),
    do: {meta[:line], meta[:column], meta[:column] + String.length(meta[:token])}

  defp place({sign, meta, [{:literal, _, number} = literal]})
       when sign in [:-, :+] and is_number(number),
       do: put_elem(place(literal), 1, meta[:column])

  defp place(_other), do: nil

  # If the list begins on a new line, each added number gets a line of its own.
  defp added(_list, _text, []), do: []

  defp added({meta, items}, text, numbers) do
    pairs = Enum.map(numbers, fn {key, number} -> "#{key}: #{number}" end)
    {first, column} = {meta[:line], meta[:column] + 1}
    begins = Enum.find_value(items, meta[:closing][:line], fn {{_, key, _}, _} -> key[:line] end)

    if begins == first do
      behind = if items == [], do: "", else: ", "
      [{{first, column, column}, Enum.join(pairs, ", ") <> behind}]
    else
      [indent] = Regex.run(~r/^[ \t]*/, text |> String.split("\n") |> Enum.at(first))
      behind = if items == [], do: "\n", else: ",\n"
      [{{first + 1, 1, 1}, indent <> Enum.join(pairs, ",\n" <> indent) <> behind}]
    end
  end

  defp change({{line, from, to}, new}, text) do
    {before, [old | behind]} = text |> String.split("\n") |> Enum.split(line - 1)
    new = String.slice(old, 0, from - 1) <> new <> String.slice(old, (to - 1)..-1//1)
    Enum.join(before ++ [new | behind], "\n")
  end
end
