defmodule Missions.Flock.Apart do
  @moduledoc false
  # Says why the flock does not come together: which member is apart, how far, what lies between, and for how long it has stood.
  # Pure; metres, in the frame of the map.
  alias Hal.Pose
  alias Missions.Flock.{Members, Sight}
  alias Nav.{Grid, Reach}
  alias Robot.Percept

  # A member stands that has not moved by so many metres in so long, nor by a third of what it would at its speed.
  @moved 0.3
  @stood_ms 10_000
  # Of a name so many characters are said.
  @name 8

  @typedoc "Where each member was when it last had moved, and since when."
  @type stood :: %{(atom() | nil) => {Pose.point(), since_ms :: integer()}}

  @doc "Where these members stand, and since when, if they drive at this speed (m/s)."
  @spec stood(stood(), [{atom() | nil, Pose.point()}], speed :: float(), integer()) :: stood()
  def stood(stood, members, speed, now_ms) do
    moved = min(@moved, speed * @stood_ms / 3_000)

    for {id, at} <- members, into: %{} do
      case stood do
        %{^id => {place, _since_ms} = before} ->
          {id, if(Pose.distance(place, at) < moved, do: before, else: {at, now_ms})}

        _new ->
          {id, {at, now_ms}}
      end
    end
  end

  @doc """
  Whether a flock of this spacing and radius (metres) rests at a point: its middle, which is noted under `nil`, has stood for 10 s, a
  member is nearer to the point than the spacing, and the middle is within the radius of it, or walls leave no room for that
  round the point.
  """
  @spec rest?(stood(), Pose.point(), flock :: map(), Grid.t() | nil, integer()) :: boolean()
  def rest?(stood, point, %{spacing: spacing, radius: radius}, grid, now_ms) do
    {{middle, since_ms}, members} = Map.pop!(stood, nil)

    now_ms - since_ms >= @stood_ms and
      Enum.any?(members, fn {_id, {at, _since_ms}} -> Pose.distance(at, point) < spacing end) and
      (Pose.distance(middle, point) < radius or
         (grid != nil and not Grid.free?(grid, point, radius)))
  end

  @doc """
  The member that is farthest from the greatest group (`Missions.Flock.Members.groups/2`), in words. Of one
  group, that its middle stands; `nil` if it does not.

      iex> percept = %Robot.Percept{robot: :mag1, at_ms: 0, profile: Hal.Profile.magellan()}
      iex> groups = [[mag1: {0.0, 0.0}, mag2: {1.0, 0.0}], [min1: {5.0, 0.0}]]
      iex> Missions.Flock.Apart.words(groups, %{min1: {{5.0, 0.0}, 3_000}}, 27_000, percept)
      "min1 is 4.0 m from mag2, stood 24 s"
      iex> Missions.Flock.Apart.words([[mag1: {0.0, 0.0}]], %{nil => {{0.0, 0.0}, 0}}, 12_000, percept)
      "its middle stood 12 s"
  """
  @spec words([[Members.member()]], stood(), integer(), Percept.t()) :: String.t() | nil
  def words([_all], stood, now_ms, _percept) do
    with ", " <> words <- stands(stood[nil], now_ms),
         do: "its middle #{words}",
         else: ("" -> nil)
  end

  def words([most | others], stood, now_ms, %Percept{grid: grid, profile: %{radius: radius}}) do
    {id, at, {near, to}} =
      others
      |> Enum.concat()
      |> Enum.map(fn {id, at} -> {id, at, Enum.min_by(most, &Pose.distance(elem(&1, 1), at))} end)
      |> Enum.max_by(fn {_id, at, {_near, to}} -> Pose.distance(at, to) end)

    "#{name(id)} is #{Float.round(Pose.distance(at, to), 1)} m from #{name(near)}" <>
      between(grid, at, to, radius) <> stands(stood[id], now_ms)
  end

  defp name(id), do: id |> Atom.to_string() |> String.slice(0, @name)

  defp between(nil, _at, _to, _radius), do: ""

  defp between(grid, at, to, radius) do
    cond do
      Sight.line?(grid, at, to) -> ""
      Grid.Way.find(grid, at, to, Reach.room(radius)) == nil -> ", no way between"
      true -> ", a wall between"
    end
  end

  defp stands({_at, since_ms}, now_ms) when now_ms - since_ms >= @stood_ms,
    do: ", stood #{div(now_ms - since_ms, 1_000)} s"

  defp stands(_moves, _now_ms), do: ""
end
