defmodule Robot.File.Edit do
  @moduledoc """
  Changes numbers in the text of a robot file and nothing else: remarks, order and layout stay. Pure.
  """

  @doc """
  The text with these numbers under `conversions:`; those that are not there are put in. Whoever writes the
  result compares what the two files say.

      iex> Robot.File.Edit.conversions("[drive: {D, [conversions: [angle: 1.0, range: 2]]}]", angle: 3.5)
      {:ok, "[drive: {D, [conversions: [angle: 3.5, range: 2]]}]"}
      iex> Robot.File.Edit.conversions("[drive: {D, [conversions: []]}]", angle: 3.5)
      {:ok, "[drive: {D, [conversions: [angle: 3.5]]}]"}
      iex> Robot.File.Edit.conversions("[drive: {D, []}]", angle: 3.5)
      {:error, "there is no list conversions: [...] in it"}
  """
  @spec conversions(String.t(), keyword(number())) :: {:ok, String.t()} | {:error, String.t()}
  def conversions(text, numbers) do
    numbers
    |> Enum.reverse()
    |> Enum.reduce_while({:ok, text}, fn {key, number}, {:ok, text} ->
      case place(text) do
        {:ok, from, size} -> {:cont, {:ok, put(text, from, size, key, "#{number}")}}
        :error -> {:halt, {:error, "there is no list conversions: [...] in it"}}
      end
    end)
  end

  # Between the brackets.
  defp place(text) do
    bare = bare(text)

    with [{start, length}] <- Regex.run(~r/(?<![a-z_])conversions:\s+\[/, bare, return: :index),
         from = start + length,
         {:ok, size} <- closing(binary_part(bare, from, byte_size(bare) - from), 0, 0) do
      {:ok, from, size}
    else
      _none -> :error
    end
  end

  # Text and remarks as blanks, byte for byte: what stands in them is not a key.
  defp bare(text) do
    Regex.replace(~r/"(?:\\.|[^"\\])*"|#[^\n]*/s, text, fn hit ->
      String.duplicate(" ", byte_size(hit))
    end)
  end

  defp closing("]" <> _rest, 0, size), do: {:ok, size}
  defp closing("]" <> rest, depth, size), do: closing(rest, depth - 1, size + 1)
  defp closing("[" <> rest, depth, size), do: closing(rest, depth + 1, size + 1)
  defp closing(<<_, rest::binary>>, depth, size), do: closing(rest, depth, size + 1)
  defp closing(<<>>, _depth, _size), do: :error

  defp put(text, from, size, key, number) do
    inside = binary_part(text, from, size)
    before = binary_part(text, 0, from)
    behind = binary_part(text, from + size, byte_size(text) - from - size)

    found =
      Regex.run(~r/(?<![a-z_])#{key}:\s+([-+0-9][0-9A-Za-z_.+-]*)/, bare(inside), return: :index)

    case found do
      [_all, {at, length}] ->
        rest = binary_part(inside, at + length, size - at - length)
        before <> binary_part(inside, 0, at) <> number <> rest <> behind

      nil ->
        before <> first("#{key}: #{number}", inside) <> behind
    end
  end

  # On a line of its own where the list has lines.
  defp first(pair, inside) do
    comma = if String.trim(bare(inside)) == "", do: "", else: ","

    case Regex.run(~r/^[ \t]*(?:#[^\n]*)?\n([ \t]*)/, inside) do
      [_all, indent] -> "\n" <> indent <> pair <> comma <> inside
      nil when comma == "" -> pair <> String.trim_leading(inside)
      nil -> pair <> comma <> " " <> String.trim_leading(inside)
    end
  end
end
