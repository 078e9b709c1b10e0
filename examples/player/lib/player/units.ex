defmodule Player.Units do
  @moduledoc """
  Converts lengths and angles of Player's configuration files to metres and radians. Pure.

  Player 1.x writes millimetres and degrees, Player 2 and 3 metres (or the file's `unit_length`)
  and degrees or radians (`unit_angle`). Files that were converted from the older to the newer
  sometimes kept their old numbers, so a length above 10 m is taken for millimetres; what was
  assumed is reported.

  Angles stay as they are written: `{:deg, 247.5}` is in degrees, a number is in radians.
  """

  alias Player.Addresses

  @typedoc "Player 1.x or later; and what the file says its units are."
  @type context :: %{
          version: 1 | 2,
          unit_length: float(),
          unit_angle: :degrees | :radians | nil
        }
  @type angle :: float() | {:deg, float()}

  @typedoc """
  The result for an option: values for keys of the robot file, perhaps with what was assumed;
  nothing, if it has no meaning of its own; or why it is left out.
  """
  @type carried ::
          {:ok, [{path :: [atom()], term()}]}
          | {:assumed, [{path :: [atom()], term()}], String.t()}
          | :used
          | {:left, String.t()}

  # No robot is this long, and no sensor this far from its middle.
  @longest_m 10
  # Angles are written from -180 to 180 or from 0 to 360 degrees.
  @turn 2 * :math.pi() + 0.01

  @doc """
  The units of a file, from its global options and the names that its drivers use; `asked` is what
  a person asked for, or `nil`.
  """
  @spec context([Player.Sections.option()], [Player.Sections.section()], 1 | 2 | nil) ::
          context()
  def context(options, sections, asked) do
    words = for {name, _line, value} when is_binary(value) <- options, do: {name, value}

    %{
      version: asked || version(sections),
      unit_length: unit_length(List.keyfind(words, "unit_length", 0)),
      unit_angle: unit_angle(List.keyfind(words, "unit_angle", 0))
    }
  end

  @doc """
  The length in a driver's option: `{metres, assumed}`, where `assumed` is `nil` or what was
  assumed.

      iex> Player.Units.length_m(630, %{version: 1, unit_length: 1.0, unit_angle: nil})
      {0.63, nil}
      iex> Player.Units.length_m(630, %{version: 2, unit_length: 1.0, unit_angle: nil})
      {0.63, "taken for millimetres: nothing on a robot is 630 m"}
  """
  @spec length_m(number(), context()) :: {float(), String.t() | nil}
  def length_m(value, %{version: 1}), do: {metres(value / 1000), nil}

  def length_m(value, %{version: 2}) when abs(value) > @longest_m,
    do: {metres(value / 1000), "taken for millimetres: nothing on a robot is #{value} m"}

  def length_m(value, %{version: 2}), do: {metres(value * 1.0), nil}

  @doc """
  Places: `[{x, y, angle}]` in metres. All of them are in the same unit, so one that is too far
  decides for all.
  """
  @spec places([{number(), number(), angle()}], context()) ::
          {[{float(), float(), angle()}], String.t() | nil}
  def places(places, context) do
    far = Enum.any?(places, fn {x, y, _angle} -> abs(x) > @longest_m or abs(y) > @longest_m end)

    cond do
      context.version == 1 ->
        {scale(places, 0.001), nil}

      far ->
        {scale(places, 0.001),
         "taken for millimetres: no sensor is more than #{@longest_m} m away"}

      true ->
        {scale(places, context.unit_length), nil}
    end
  end

  @doc """
  The angles of an option whose name does not tell the unit.

      iex> Player.Units.angles([0, 247.5], %{version: 2, unit_length: 1.0, unit_angle: nil})
      {[{:deg, 0.0}, {:deg, 247.5}], "angles taken for degrees: in radians they would be more than a turn"}
  """
  @spec angles([number()], context()) :: {[angle()], String.t() | nil}
  def angles(angles, context) do
    cond do
      context.version == 1 or context.unit_angle == :degrees ->
        {Enum.map(angles, &{:deg, &1 * 1.0}), nil}

      context.unit_angle == nil and Enum.any?(angles, &(abs(&1) > @turn)) ->
        {Enum.map(angles, &{:deg, &1 * 1.0}),
         "angles taken for degrees: in radians they would be more than a turn"}

      true ->
        {Enum.map(angles, &radians/1), nil}
    end
  end

  @doc "Applies a function that turns a value, which may have been assumed, into keys."
  @spec told({value, String.t() | nil}, (value -> [{[atom()], term()}])) :: carried()
        when value: term()
  def told({value, nil}, pairs), do: {:ok, pairs.(value)}
  def told({value, assumed}, pairs), do: {:assumed, pairs.(value), assumed}

  @doc "Whether a number can be an angle in radians."
  @spec radians?(number()) :: boolean()
  def radians?(number), do: abs(number) <= @turn

  @doc "A rounded angle in radians, as in `Robot.File`."
  @spec radians(number()) :: float()
  def radians(angle), do: Float.round(angle * 1.0, 6)

  # A length, rounded to a micrometre: further digits come from a division.
  defp metres(length), do: Float.round(length * 1.0, 6)

  defp scale(places, factor),
    do: for({x, y, angle} <- places, do: {metres(x * factor), metres(y * factor), angle})

  # The names of the options decide: those of later versions have no "mm" any more, or say metres.
  defp version(sections) do
    names = for section <- sections, {name, _line, _value} <- section.options, do: name
    newer? = Enum.any?(names, &(&1 in ~w(m_length m_width mrad_sonar_poses sonar_max_range)))
    older? = Enum.any?(names, &(&1 in ~w(mm_length mm_width mmrad_sonar_poses)))

    cond do
      older? -> 1
      newer? -> 2
      Enum.any?(sections, &provides?(&1, "position2d")) -> 2
      Enum.any?(sections, &provides?(&1, "position")) -> 1
      true -> 2
    end
  end

  defp provides?(section, interface),
    do: Enum.any?(Addresses.provided(section), &(&1.interface == interface))

  defp unit_length({_name, "mm"}), do: 0.001
  defp unit_length({_name, "cm"}), do: 0.01
  defp unit_length(_metres), do: 1.0

  defp unit_angle({_name, "radians"}), do: :radians
  defp unit_angle({_name, "degrees"}), do: :degrees
  defp unit_angle(_none), do: nil
end
