defmodule Console.Picture.Svg do
  @moduledoc "Elements of a drawing as iodata, everything escaped. Pure."

  @doc """
  An element with attributes and children; numbers are shortened to two decimals.

      iex> "a<b" |> Console.Picture.Svg.text(1, 2.345, fill: "red") |> IO.iodata_to_binary()
      ~s(<text x="1" y="2.35" fill="red">a&lt;b</text>)
  """
  @spec element(atom(), keyword(), iodata() | nil) :: iodata()
  def element(name, attributes, children \\ nil) do
    name = Atom.to_string(name)
    open = ["<", name, Enum.map(attributes, &attribute/1)]
    if children, do: [open, ">", children, "</", name, ">"], else: [open, "/>"]
  end

  @doc "A whole drawing of this size, in pixels, on white."
  @spec document(number(), number(), iodata()) :: iodata()
  def document(width, height, children) do
    [
      ~s(<?xml version="1.0" encoding="UTF-8"?>\n),
      element(
        :svg,
        [
          xmlns: "http://www.w3.org/2000/svg",
          width: width,
          height: height,
          viewBox: "0 0 #{round(width)} #{round(height)}",
          font_family: "DejaVu Sans, Verdana, Helvetica, sans-serif"
        ],
        [element(:rect, width: width, height: height, fill: "#FFFFFF") | children]
      ),
      "\n"
    ]
  end

  @doc "A line of text at a place."
  @spec text(String.t(), number(), number(), keyword()) :: iodata()
  def text(content, x, y, attributes \\ []),
    do: element(:text, [x: x, y: y] ++ attributes, escape(content))

  @doc "A group."
  @spec group(keyword(), iodata()) :: iodata()
  def group(attributes, children), do: element(:g, attributes, children)

  @doc """
  A polyline's points.

      iex> Console.Picture.Svg.points([{0, 1.5}, {2, 3}])
      "0,1.5 2,3"
  """
  @spec points([{number(), number()}]) :: String.t()
  def points(places), do: Enum.map_join(places, " ", fn {x, y} -> "#{short(x)},#{short(y)}" end)

  defp attribute({_name, nil}), do: []

  defp attribute({name, value}),
    do: [" ", name |> Atom.to_string() |> String.replace("_", "-"), "=\"", worth(value), "\""]

  defp worth(number) when is_number(number), do: short(number)
  defp worth(text), do: escape(text)

  defp short(number) when is_integer(number), do: Integer.to_string(number)

  defp short(number) do
    case Float.round(number, 2) do
      zero when zero == 0.0 ->
        "0"

      rounded ->
        rounded |> :erlang.float_to_binary([:compact, decimals: 2]) |> String.trim_trailing(".0")
    end
  end

  defp escape(text) do
    text
    |> String.replace("&", "&amp;")
    |> String.replace("<", "&lt;")
    |> String.replace(">", "&gt;")
    |> String.replace("\"", "&quot;")
  end
end
