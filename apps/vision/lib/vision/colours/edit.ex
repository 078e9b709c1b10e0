defmodule Vision.Colours.Edit do
  @moduledoc """
  Writes a colour into the text of a CMVision colour file; comments and the other colours are
  kept. Pure.
  """
  alias Vision.Colours

  @doc """
  The text with this class: if the text has it already, its limits are changed; if not, it becomes
  the last one. An empty text becomes a complete colour file. The error is one line.

      iex> class = %{name: "Red", rgb: {255, 0, 0}, merge: 0.5, expected: 10, y: {30, 160}, u: {80, 122}, v: {165, 240}}
      iex> {:ok, text} = Vision.Colours.Edit.put("", class)
      iex> text
      "[Colors]\\n(255,0,0) 0.500000 10 Red\\n\\n[Thresholds]\\n( 30:160, 80:122,165:240)\\n"
      iex> {:ok, text} = Vision.Colours.Edit.put(text, %{class | v: {170, 240}})
      iex> text =~ "( 30:160, 80:122,170:240)"
      true
  """
  @spec put(String.t(), map()) :: {:ok, String.t()} | {:error, String.t()}
  def put(text, class) do
    with :ok <- name(class.name) do
      if String.trim(text) == "", do: {:ok, fresh(class)}, else: merge(text, class)
    end
  end

  defp name(name) do
    if name =~ ~r/\A[^\s#[:cntrl:]][^\s[:cntrl:]]{0,59}\z/u,
      do: :ok,
      else:
        {:error, "name of a colour: expected one word of up to 60 letters, got #{inspect(name)}"}
  end

  defp fresh(class), do: "[Colors]\n#{colour(class)}\n\n[Thresholds]\n#{limits(class)}\n"

  defp merge(text, class) do
    with {:ok, %{classes: classes}} <- Colours.parse(text),
         lines = String.split(text, "\n"),
         new = lines |> change(classes, class) |> Enum.join("\n"),
         {:ok, changed} <- Colours.parse(new),
         :ok <- same(changed.classes, classes, class) do
      {:ok, new}
    end
  end

  # The k-th line after a header belongs to the k-th class: `parse/1` took the same lines.
  defp change(lines, classes, class) do
    thresholds = header(lines, "[thresholds]") + 1

    case Enum.find_index(classes, &(&1.name == class.name)) do
      nil ->
        count = length(classes)

        places = [
          {header(lines, "[colors]") + 1 + count, colour(class)},
          {thresholds + count, limits(class)}
        ]

        # The later one first, so that it does not move the other.
        places
        |> Enum.sort(:desc)
        |> Enum.reduce(lines, fn {at, line}, lines -> insert(lines, at, line) end)

      k ->
        List.replace_at(lines, thresholds + k, limits(class))
    end
  end

  # This works at the end of a text without a final line end too.
  defp insert(lines, at, line), do: List.insert_at(lines, at, line)

  defp header(lines, name),
    do: Enum.find_index(lines, &(&1 |> String.downcase() |> String.starts_with?(name)))

  defp same(changed, classes, class) do
    expected = Enum.map(classes, &if(&1.name == class.name, do: bounds(class), else: bounds(&1)))
    added = if class.name in Enum.map(classes, & &1.name), do: [], else: [bounds(class)]

    if Enum.map(changed, &bounds/1) == expected ++ added,
      do: :ok,
      else: {:error, "the colour file is written in a way that #{class.name} cannot be put into"}
  end

  defp bounds(class), do: Map.take(class, [:name, :y, :u, :v])

  defp colour(%{rgb: {r, g, b}} = class) do
    merge = :erlang.float_to_binary(class.merge * 1.0, decimals: 6)
    "(#{r},#{g},#{b}) #{merge} #{class.expected} #{class.name}"
  end

  @doc """
  The limits of a class as a line of a colour file.

      iex> Vision.Colours.Edit.limits(%{y: {170, 240}, u: {60, 90}, v: {130, 145}})
      "(170:240, 60: 90,130:145)"
  """
  @spec limits(map()) :: String.t()
  def limits(class) do
    pairs = for {low, high} <- [class.y, class.u, class.v], do: "#{pad(low)}:#{pad(high)}"
    "(#{Enum.join(pairs, ",")})"
  end

  defp pad(value), do: String.pad_leading("#{value}", 3)
end
