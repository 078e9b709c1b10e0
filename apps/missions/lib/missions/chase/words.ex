defmodule Missions.Chase.Words do
  @moduledoc false
  # Says what a robot of a chase claims, knows, and draws over the map. Pure.
  alias Missions.Chase.{Driver, Track}

  @doc "What it claims; `scene` is what it knows of the ball."
  @spec claim(Missions.Chase.t(), map() | nil) :: map()
  def claim(mission, scene) do
    %{
      phase: mission.phase,
      standing: mission.phase == :scored,
      formed: mission.phase == :scored,
      blocked: mission.why != nil,
      blocked_by: mission.why,
      says: says(mission, scene)
    }
  end

  defp says(%{track: nil}, nil), do: "looks for the ball"

  defp says(mission, nil) do
    seconds = div(mission.now_ms - mission.track.seen_ms, 1000)
    "looks for the ball, not seen for #{seconds} s"
  end

  defp says(%{phase: :scored}, scene),
    do: "the ball is #{metres(scene.far)} m from the goal's middle"

  defp says(%{looks?: true}, _scene), do: "drives, and looks where the ball is"
  defp says(%{phase: :push}, scene), do: "pushes the ball, #{metres(scene.far)} m from the goal"

  defp says(%{phase: :approach}, scene),
    do: "gets behind the ball, #{metres(scene.far)} m from the goal"

  defp says(mission, scene) do
    drives = Driver.other(mission.heard, mission.now_ms)

    "in the ring, #{if drives, do: "#{drives} drives", else: "no robot drives"}, #{metres(scene.far)} m from the goal"
  end

  defp metres(far), do: Float.round(far, 1)

  @doc "See `c:Robot.Mission.explain/1`."
  @spec explain(Missions.Chase.t()) :: [{String.t(), String.t()}]
  def explain(%{track: nil}), do: [{"ball", "not seen yet"}]

  def explain(%{track: track, now_ms: now_ms} = mission) do
    {{x, y}, sd} = Track.place(track, now_ms)

    costs =
      for {id, peer} <- Enum.sort(mission.heard), do: "#{id} #{peer.cost && metres(peer.cost)}"

    [
      {"ball",
       "#{metres(x)},#{metres(y)}, within #{metres(2.45 * sd)} m, seen #{now_ms - track.seen_ms} ms ago"},
      {"drives",
       "#{if Driver.drives?(mission.driver), do: mission.me, else: Driver.other(mission.heard, now_ms) || "no robot"}"},
      {"costs of others, metres", if(costs == [], do: "none heard", else: Enum.join(costs, ", "))}
    ]
  end

  @doc "See `c:Robot.Mission.layer/1`."
  @spec layer(Missions.Chase.t()) :: Robot.Mission.layer()
  def layer(mission) do
    ball = if mission.track, do: [point(mission.track.at, "ball")], else: []

    [
      {:polyline, "goal", circle(mission.goal, mission.within)},
      {:points, "goal and ball", [point(mission.goal, "goal") | ball]},
      {:polyline, "way of the ball", Enum.reverse(mission.trail)}
    ] ++
      if(mission.track,
        do: [{:polyline, "ring", circle(mission.track.at, mission.ring)}],
        else: []
      )
  end

  defp point({x, y}, label), do: {x, y, label}

  defp circle({x, y}, radius) do
    for k <- 0..24,
        angle = k * :math.pi() / 12,
        do: {x + radius * :math.cos(angle), y + radius * :math.sin(angle)}
  end

  @doc "The stages of this tick; `before` is the phase of the one before."
  @spec stages(Missions.Chase.t(), atom()) :: [Robot.Mission.effect()]
  def stages(%{phase: phase}, phase), do: []

  def stages(%{phase: :scored}, _before),
    do: [{:stage, :scored, %{says: "says that the ball is in the goal"}}]

  def stages(%{phase: :approach}, before) when before in [:ring, :search],
    do: [{:stage, :drives, %{says: "drives the ball"}}]

  def stages(_mission, _before), do: []
end
