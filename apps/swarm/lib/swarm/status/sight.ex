defmodule Swarm.Status.Sight do
  @moduledoc """
  Describes where a robot's camera looks, and what it shows of the landmark: a part of `Swarm.Status`. Pure.

  The landmark is what the robot's mission takes for it (its option `colour`), else the first colour of the robot's file.
  Angles are in radians, left and up positive, from the robot's body; the zoom is the horizontal field of view.
  """
  alias Robot.Percept
  alias Robot.Percept.Sighting

  # Readings that are older (ms) tell nothing of now.
  @recent_ms 1_000
  # An angle (mrad) and a distance (mm) as a row has them.
  @angle 7_000
  @far 1_000_000
  @longest 80

  @typedoc "Where the camera looks, `nil` if nothing has told that within a second."
  @type head :: %{pan: float(), tilt: float(), field_of_view: float()} | nil
  @typedoc """
  The landmark in the newest picture: `bearing` is `nil` if it is not seen, `distance` (metres) also if it is not known. `nil`
  without a picture within a second.
  """
  @type t :: %{colour: String.t(), bearing: float() | nil, distance: float() | nil} | nil

  @doc "The head by the entries of a robot's board, with their ages."
  @spec head(%{term() => {term(), non_neg_integer()}}) :: head()
  def head(entries) do
    with %{} = ptz <- recent(entries, :ptz),
         do: Map.take(ptz, [:pan, :tilt, :field_of_view])
  end

  @doc "The landmark, by the same, for a robot of this config, or what of it is needed."
  @spec of(
          %{
            required(:id) => atom(),
            required(:profile) => Hal.Profile.t(),
            required(:colours) => struct() | nil,
            required(:mission) => {module(), keyword()} | nil,
            optional(atom()) => term()
          },
          %{term() => {term(), non_neg_integer()}}
        ) :: t()
  def of(config, entries) do
    with %{} = picture <- recent(entries, :detections),
         colour when colour != nil <- colour(config, entries) do
      percept = %Percept{
        robot: config.id,
        at_ms: picture.at_ms,
        profile: config.profile,
        detections: picture,
        ptz: recent(entries, :ptz)
      }

      seen = Sighting.of(percept, colour) || %{bearing: nil, distance: nil}
      %{colour: colour, bearing: seen.bearing, distance: seen.distance}
    end
  end

  defp colour(config, entries) do
    options =
      case {entries, config.mission} do
        {%{mission: {%{options: [_ | _] = options}, _age_ms}}, _begun} -> options
        {_none, {_mission, options}} -> options
        _neither -> []
      end

    options[:colour] || first(config.colours)
  end

  defp first(%{classes: [%{name: name} | _]}), do: name
  defp first(_none), do: nil

  defp recent(entries, key) do
    case entries do
      %{^key => {value, age_ms}} when age_ms <= @recent_ms -> value
      _none_or_old -> nil
    end
  end

  @doc """
  In words, as a status has them; `nil` for what is not known.

      iex> alias Swarm.Status.Sight
      iex> Sight.words(%{pan: 0.21, tilt: 0.0, field_of_view: 0.85})
      "looks at 12, 0 deg (zoom 49 deg)"
      iex> Sight.words(%{colour: "Yellow", bearing: -0.21, distance: 2.314})
      "sees Yellow at -12 deg, 2.31 m"
      iex> Sight.words(%{colour: "Yellow", bearing: nil, distance: nil})
      "sees no Yellow"
  """
  @spec words(head() | t()) :: String.t() | nil
  def words(nil), do: nil

  def words(%{pan: pan, tilt: tilt, field_of_view: zoom}),
    do: "looks at #{degrees(pan)}, #{degrees(tilt)} deg (zoom #{degrees(zoom)} deg)"

  def words(%{colour: colour, bearing: nil}), do: "sees no #{colour}"

  def words(%{colour: colour, bearing: bearing, distance: distance}),
    do: "sees #{colour} at #{degrees(bearing)} deg, #{metres(distance)}"

  defp degrees(radians), do: round(radians * 180 / :math.pi())
  defp metres(nil), do: "distance unknown"
  defp metres(distance), do: :erlang.float_to_binary(distance * 1.0, decimals: 2) <> " m"

  @doc "As a row of the blackboard has them: whole numbers."
  @spec encode(head() | t()) :: tuple() | nil
  def encode(nil), do: nil
  def encode(%{pan: pan, tilt: tilt, field_of_view: zoom}), do: {mm(pan), mm(tilt), mm(zoom)}

  def encode(%{colour: colour, bearing: bearing, distance: distance}),
    do:
      {String.slice(colour, 0, div(@longest, 4)), bearing && mm(bearing),
       distance && mm(distance)}

  defp mm(number), do: round(number * 1000)

  @doc "The head that a row tells of; `nil` for anything else."
  @spec decode_head(term()) :: head()
  def decode_head({pan, tilt, zoom})
      when pan in -@angle..@angle and tilt in -@angle..@angle and zoom in 0..@angle,
      do: %{pan: pan / 1000, tilt: tilt / 1000, field_of_view: zoom / 1000}

  def decode_head(_other), do: nil

  @doc "What a row tells of the landmark; `nil` for anything else."
  @spec decode(term()) :: t()
  def decode({colour, bearing, distance})
      when is_binary(colour) and byte_size(colour) <= @longest and
             (bearing == nil or bearing in -@angle..@angle) and
             (distance == nil or distance in 0..@far) do
    # An escape is printable, and would reach a terminal.
    if String.printable?(colour) and not (colour =~ ~r/[[:cntrl:]]/),
      do: %{
        colour: colour,
        bearing: bearing && bearing / 1000,
        distance: distance && distance / 1000
      }
  end

  def decode(_other), do: nil
end
