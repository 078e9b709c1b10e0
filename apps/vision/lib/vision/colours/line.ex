defmodule Vision.Colours.Line do
  @moduledoc false
  # Reads the lines of a CMVision colour file, from left to right, as C's `scanf` does: what was read once is not read again
  # as something else. Pure.
  #
  # The name of a colour is a word; what begins with `#` is a remark, not a name. Remarks may follow a line.

  @doc """
  What a line of a section says after its first bracket.

      iex> Vision.Colours.Line.read(:colours, "255,255,0) 0.5 10 Yellow")
      {:ok, %{rgb: {255, 255, 0}, merge: 0.5, expected: 10, name: "Yellow"}}
      iex> Vision.Colours.Line.read(:colours, "255,255,0) 0.5 10")
      :error
      iex> Vision.Colours.Line.read(:thresholds, "170:240, 60: 90,130:145)")
      {:ok, [170, 240, 60, 90, 130, 145]}
  """
  @spec read(:colours | :thresholds, binary()) :: {:ok, map() | [integer()]} | :error
  def read(:colours, line) do
    with {:ok, [r, g, b], rest} <- integers(line, [",", ",", ")"]),
         {:ok, merge, rest} <- float(blank(rest)),
         {:ok, expected, rest} <- spaced(rest),
         {:ok, name} <- name(blank(rest)),
         do: {:ok, %{rgb: {r, g, b}, merge: merge, expected: expected, name: name}}
  end

  def read(:thresholds, line) do
    with {:ok, limits, _remark} <- integers(line, [":", ",", ":", ",", ":", ")"]),
         do: {:ok, limits}
  end

  # Each number with the mark behind it.
  defp integers(text, marks) do
    Enum.reduce_while(marks, {:ok, [], text}, fn mark, {:ok, read, text} ->
      with {:ok, number, rest} <- integer(blank(text)),
           {^mark, rest} <- mark(mark, rest) do
        {:cont, {:ok, read ++ [number], rest}}
      else
        _other -> {:halt, :error}
      end
    end)
  end

  # Blanks are allowed before the last bracket only.
  defp mark(")", text), do: first(blank(text))
  defp mark(_mark, text), do: first(text)

  defp first(<<mark::binary-size(1), rest::binary>>), do: {mark, rest}
  defp first(""), do: :error

  defp integer(text) do
    case Integer.parse(text) do
      {number, rest} -> {:ok, number, rest}
      :error -> :error
    end
  end

  # A number behind a blank at least.
  defp spaced(text) do
    case blank(text) do
      ^text -> :error
      rest -> integer(rest)
    end
  end

  # As C reads them: also "5." and ".5".
  defp float(text) do
    {digits, rest} = digits(text, 0)

    case {digits, Float.parse("0" <> digits)} do
      {"", _none} -> :error
      {".", _none} -> :error
      {_digits, {number, left}} when left in ["", "."] -> {:ok, number, rest}
      _broken -> :error
    end
  end

  defp digits(text, n) do
    case text do
      <<_::binary-size(n), c, _::binary>> when c in ?0..?9 or c in ~c".eE" ->
        digits(text, n + 1)

      <<_::binary-size(n), c, _::binary>> when c in ~c"+-" and n > 0 ->
        if :binary.at(text, n - 1) in ~c"eE", do: digits(text, n + 1), else: cut(text, n)

      _end ->
        cut(text, n)
    end
  end

  defp cut(text, n), do: {binary_part(text, 0, n), binary_part(text, n, byte_size(text) - n)}

  defp name("#" <> _remark), do: :error

  defp name(text) do
    case text |> String.split(~r/[\s[:cntrl:]]/u, parts: 2) |> hd() do
      "" -> :error
      name -> {:ok, name}
    end
  end

  defp blank(<<c, rest::binary>>) when c in ~c" \t\v\f", do: blank(rest)
  defp blank(text), do: text
end
