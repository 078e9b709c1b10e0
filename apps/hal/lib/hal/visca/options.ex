defmodule Hal.Visca.Options do
  @moduledoc """
  What `Hal.Visca.Driver` may be told, checked. Pure.

  | option | allowed | default |
  |---|---|---|
  | `:port` | path of the serial device | must be given |
  | `:speed` | baud, 1 to 20,000,000 | `9600`, what the camera speaks |
  | `:serial` | further options of `Hal.Serial.open/1` | `[]` |
  | `:camera` | 1 to 7: its place on the cable | `1` |
  | `:lens` | `{tele, wide}`: horizontal fields of view in radians, above 0, ascending, below pi | 4.4 and 48.8 degrees |
  | `:field_of_view` | radians to zoom to at the opening, above 0 and below pi; `nil`: leave it | `nil` |
  | `:poll_ms` | 50 to 400: how often the position is asked for | `100` |
  """

  @degree :math.pi() / 180
  @defaults [
    speed: 9_600,
    serial: [],
    camera: 1,
    lens: {4.4 * @degree, 48.8 * @degree},
    field_of_view: nil,
    poll_ms: 100
  ]
  @keys [:port | Keyword.keys(@defaults)]

  @doc """
  All options, with the defaults; or one line that names what is wrong.

      iex> {:ok, options} = Hal.Visca.Options.check(port: "/dev/ttyS2")
      iex> {options[:speed], options[:poll_ms]}
      {9600, 100}
      iex> Hal.Visca.Options.check(port: "/dev/ttyS2", camera: 8)
      {:error, "camera option :camera cannot be 8: it must be 1 to 7"}
  """
  @spec check(keyword()) :: {:ok, keyword()} | {:error, String.t()}
  def check(options) do
    cond do
      not Keyword.keyword?(options) ->
        {:error, "camera options cannot be #{show(options)}: they must be a keyword list"}

      unknown = Enum.find(Keyword.keys(options), &(&1 not in @keys)) ->
        allowed = Enum.map_join(@keys, ", ", &inspect/1)
        {:error, "there is no camera option #{show(unknown)}: allowed are #{allowed}"}

      wrong = Enum.find(options, fn {key, value} -> not valid?(key, value) end) ->
        {key, value} = wrong

        {:error,
         "camera option #{inspect(key)} cannot be #{show(value)}: it must be #{rule(key)}"}

      true ->
        line(Keyword.merge(@defaults, options))
    end
  end

  @doc "The options of the serial line among these (as `check/1` gives them)."
  @spec serial(keyword()) :: keyword()
  def serial(options), do: Keyword.merge(options[:serial], Keyword.take(options, [:port, :speed]))

  # The line knows best what it takes.
  defp line(options) do
    case {options[:port], Hal.Serial.options(serial(options))} do
      {nil, _} -> {:error, "camera option :port is missing: it must be #{rule(:port)}"}
      {_, {:ok, _}} -> {:ok, options}
      {_, error} -> error
    end
  end

  defp valid?(:port, path), do: is_binary(path)
  defp valid?(:speed, speed), do: is_integer(speed)

  defp valid?(:serial, list),
    do:
      Keyword.keyword?(list) and not Enum.any?([:port, :speed, :pty], &Keyword.has_key?(list, &1))

  defp valid?(:camera, n), do: n in 1..7
  defp valid?(:lens, {tele, wide}), do: angle?(tele) and angle?(wide) and tele < wide
  defp valid?(:lens, _other), do: false
  defp valid?(:field_of_view, angle), do: angle == nil or angle?(angle)
  defp valid?(:poll_ms, ms), do: ms in 50..400

  # No NaN or infinity: there are no such floats here.
  defp angle?(angle), do: is_number(angle) and angle > 0 and angle < :math.pi()

  defp rule(:port), do: "the path of a serial device"
  defp rule(:speed), do: "a whole number of baud"
  defp rule(:serial), do: "a keyword list of Hal.Serial's options but :port, :pty and :speed"
  defp rule(:camera), do: "1 to 7"

  defp rule(:lens),
    do: "{tele, wide}, fields of view in radians, ascending, between 0 and pi"

  defp rule(:field_of_view), do: "radians between 0 and pi, or nil"
  defp rule(:poll_ms), do: "milliseconds from 50 to 400"

  defp show(value), do: inspect(value, limit: 20, printable_limit: 60, width: :infinity)
end
