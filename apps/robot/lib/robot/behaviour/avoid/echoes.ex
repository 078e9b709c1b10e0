defmodule Robot.Behaviour.Avoid.Echoes do
  @moduledoc false
  # Remembers where a robot's sonars have seen something lately, and since when: what has stayed where it is, is no robot
  # that drives. Pure.
  #
  # A place is forgotten after 5 s, or as soon as a sonar sees through it.
  alias Hal.Pose
  alias Robot.Percept
  alias Robot.Safety.Reflex

  # Echoes from farther away (metres) say too little of where on the cone something is.
  @range 4.0
  @cell 0.25
  # What moves at 0.2 m/s has left the cell, and those beside it, by then.
  @stood_ms 1_500
  @kept_ms 5_000
  @every_ms 200
  # A sonar sees through what is so much nearer (metres) than its echo, and within so much (radians) of its axis.
  @margin 0.3
  @axis :math.pi() / 36

  defstruct at_ms: nil, places: %{}

  @typedoc "By cell: where in it the first echo was, and the times of the first and the last one."
  @type t :: %__MODULE__{
          at_ms: integer() | nil,
          places: %{
            {integer(), integer()} => {Pose.point(), first_ms :: integer(), last_ms :: integer()}
          }
        }

  @doc "Takes the readings of a percept, which has a pose, five times a second."
  @spec note(t(), Percept.t()) :: t()
  def note(echoes, %Percept{sonar: nil}), do: echoes

  def note(%__MODULE__{at_ms: before} = echoes, %Percept{at_ms: at_ms})
      when before != nil and at_ms - before < @every_ms,
      do: echoes

  def note(%__MODULE__{places: places}, %Percept{at_ms: at_ms} = percept) do
    reaches = reaches(percept)

    places =
      Map.filter(places, fn {_cell, {at, _first, last}} ->
        at_ms - last < @kept_ms and not through?(reaches, percept.pose, at)
      end)

    %__MODULE__{at_ms: at_ms, places: Enum.reduce(echoes(percept), places, &see(&2, &1, at_ms))}
  end

  defp echoes(%{pose: pose, profile: profile, sonar: ranges}) do
    near = for range <- ranges, do: if(near?(range), do: range, else: profile.sonar_max)
    for point <- Reflex.Body.points(profile, near), do: Pose.place(pose, point)
  end

  defp near?(range), do: is_number(range) and range < @range

  defp see(places, at, at_ms),
    do: Map.update(places, cell(at), {at, at_ms, at_ms}, &put_elem(&1, 2, at_ms))

  # How far each sonar sees, from the middle of the body.
  defp reaches(%{profile: profile, sonar: ranges}) do
    for {%{x: x, y: y, heading: heading}, range} <- Enum.zip(profile.sonars, ranges),
        is_number(range),
        do: {heading, range + :math.sqrt(x * x + y * y)}
  end

  defp through?(reaches, pose, at) do
    beyond = Pose.distance(pose, at) + @margin
    bearing = Pose.bearing(pose, at)

    Enum.any?(reaches, fn {heading, reach} ->
      reach > beyond and :math.cos(bearing - heading) > :math.cos(@axis)
    end)
  end

  @doc """
  Whether something has stood there for 1.5 s.

      iex> ahead = List.replace_at(List.duplicate(5.1, 16), 11, 1.0)
      iex> percept = %Robot.Percept{robot: :mag1, profile: Hal.Profile.magellan(), at_ms: 0, pose: Hal.Pose.new(0, 0), sonar: ahead}
      iex> echoes = Robot.Behaviour.Avoid.Echoes.note(%Robot.Behaviour.Avoid.Echoes{}, percept)
      iex> for {at, at_ms} <- [{{1.2, 0.1}, 1_400}, {{1.2, 0.1}, 1_500}, {{1.2, 0.4}, 1_500}],
      ...>   do: Robot.Behaviour.Avoid.Echoes.stands?(echoes, at, at_ms)
      [false, true, false]
  """
  @spec stands?(t(), Pose.point(), at_ms :: integer()) :: boolean()
  def stands?(%__MODULE__{places: places}, at, at_ms) do
    {i, j} = cell(at)

    Enum.any?(for(a <- (i - 1)..(i + 1), b <- (j - 1)..(j + 1), do: {a, b}), fn cell ->
      case places do
        %{^cell => {place, first, _last}} ->
          at_ms - first >= @stood_ms and Pose.distance(place, at) < @cell

        _nothing ->
          false
      end
    end)
  end

  defp cell({x, y}), do: {floor(x / @cell), floor(y / @cell)}
end
