defmodule Mcap.Foxglove.Encode do
  @moduledoc """
  Encodes the parts that Foxglove's messages are made of, as JSON. Pure. Metres and radians; times are whole
  nanoseconds.
  """

  @type point :: {number(), number()} | {number(), number(), number()}
  @type quaternion :: {number(), number(), number(), number()}

  @typedoc "A pose on the floor, or a point with a turn about the vertical or any turn."
  @type pose :: Hal.Pose.t() | {point(), yaw :: number()} | {point(), quaternion()}

  @typedoc "Red, green, blue and opacity, 0 to 1 each."
  @type color :: {number(), number(), number()} | {number(), number(), number(), number()}

  @doc """
  A number; a float in its shortest form.

      iex> Mcap.Foxglove.Encode.number(0.1)
      "0.1"
  """
  @spec number(number()) :: binary()
  def number(number) when is_float(number), do: :erlang.float_to_binary(number, [:short])
  def number(number) when is_integer(number), do: Integer.to_string(number)

  @doc """
  Text. Bytes that are not UTF-8 become question marks: a log tells what was said, whatever it was.

      iex> Mcap.Foxglove.Encode.text(<<"\\"a", 0xFF, "b\\"">>) |> IO.iodata_to_binary()
      ~S("\\"a?b\\"")
  """
  @spec text(binary()) :: iodata()
  def text(text) when is_binary(text),
    do: Hal.Json.encode!(if String.valid?(text), do: text, else: legible(text, <<>>))

  defp legible(<<rune::utf8, rest::binary>>, done),
    do: legible(rest, <<done::binary, rune::utf8>>)

  defp legible(<<_byte, rest::binary>>, done), do: legible(rest, <<done::binary, ??>>)
  defp legible(<<>>, done), do: done

  @doc """
  A time, or how long something lasts.

      iex> Mcap.Foxglove.Encode.time(1_500_000_000) |> IO.iodata_to_binary()
      ~S({"sec":1,"nsec":500000000})
  """
  @spec time(non_neg_integer()) :: iodata()
  def time(ns) when is_integer(ns) and ns >= 0 do
    [
      ~S({"sec":),
      Integer.to_string(div(ns, 1_000_000_000)),
      ~S(,"nsec":),
      Integer.to_string(rem(ns, 1_000_000_000)),
      ?}
    ]
  end

  @doc "A point or a size; one on the floor has z = 0."
  @spec point(point()) :: iodata()
  def point({x, y}), do: point({x, y, 0})

  def point({x, y, z}),
    do: [~S({"x":), number(x), ~S(,"y":), number(y), ~S(,"z":), number(z), ?}]

  @doc "A turn: about the vertical, counter-clockwise seen from above, or any."
  @spec turn(number() | quaternion()) :: iodata()
  def turn(yaw) when is_number(yaw), do: turn({0, 0, :math.sin(yaw / 2), :math.cos(yaw / 2)})

  def turn({x, y, z, w}) do
    [~S({"x":), number(x), ~S(,"y":), number(y)] ++
      [~S(,"z":), number(z), ~S(,"w":), number(w), ?}]
  end

  @doc """
  A pose.

      iex> Mcap.Foxglove.Encode.pose(Hal.Pose.new(1, 2)) |> IO.iodata_to_binary()
      ~S({"position":{"x":1.0,"y":2.0,"z":0},"orientation":{"x":0,"y":0,"z":0.0,"w":1.0}})
  """
  @spec pose(pose()) :: iodata()
  def pose(pose) do
    {point, turn} = split(pose)
    [~S({"position":), point(point), ~S(,"orientation":), turn(turn), ?}]
  end

  @doc false
  @spec split(pose()) :: {point(), number() | quaternion()}
  def split(%Hal.Pose{x: x, y: y, heading: heading}), do: {{x, y}, heading}
  def split({point, turn}), do: {point, turn}

  @doc "A colour; without the fourth number it is opaque."
  @spec color(color()) :: iodata()
  def color({r, g, b}), do: color({r, g, b, 1})

  def color({r, g, b, a}) do
    [~S({"r":), number(r), ~S(,"g":), number(g)] ++
      [~S(,"b":), number(b), ~S(,"a":), number(a), ?}]
  end

  @doc """
  An array.

      iex> Mcap.Foxglove.Encode.array([1, 2.5], &Mcap.Foxglove.Encode.number/1) |> IO.iodata_to_binary()
      "[1,2.5]"
  """
  @spec array([value], (value -> iodata())) :: iodata() when value: term()
  def array(values, encode), do: [?[, Enum.map_intersperse(values, ?,, encode), ?]]

  @doc "Bytes as text, as schemas with `contentEncoding` want them."
  @spec bytes(binary()) :: iodata()
  def bytes(bytes), do: [?", Base.encode64(bytes), ?"]
end
