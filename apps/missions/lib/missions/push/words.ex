defmodule Missions.Push.Words do
  @moduledoc "Puts into words and drawings what a robot of `Missions.Push` does and knows, for people. Pure."
  alias Missions.Push
  alias Missions.Push.{Box, Estimate, Places}

  @doc "The events of a change of phase."
  @spec stages(Push.t(), before :: atom()) :: [Robot.Mission.effect()]
  def stages(%{phase: phase}, phase), do: []

  def stages(%{phase: :done}, _before),
    do: [{:stage, :done, %{says: "says that the box is at its goal"}}]

  def stages(%{phase: :push}, _before), do: [{:stage, :pushes, %{says: "pushes the box"}}]
  def stages(_mission, _before), do: []

  @doc "What a robot claims."
  @spec claim(Push.t(), map() | nil) :: map()
  def claim(mission, scene) do
    %{
      phase: mission.phase,
      standing: mission.phase == :done,
      formed: mission.phase == :done,
      blocked: mission.why != nil,
      blocked_by: mission.why,
      says: says(mission, scene)
    }
  end

  defp says(_mission, nil), do: "looks for the box"
  defp says(%{phase: :search}, _scene), do: "looks for the box"
  defp says(%{phase: :done}, scene), do: "the box is #{metres(scene.far)} m from its goal"
  defp says(%{why: why}, _scene) when why != nil, do: why
  defp says(%{phase: :watch, looks?: true}, _scene), do: "looks how the box lies"

  defp says(%{phase: :watch} = mission, scene) do
    pushers = for {_id, %{side: side}} <- Places.fresh(mission), side != nil, do: side

    if length(pushers) < 2,
      do: "two are needed that push",
      else: "watches the box, #{metres(scene.far)} m from its goal"
  end

  defp says(%{phase: :push}, scene), do: "pushes the box, #{metres(scene.far)} m from its goal"
  defp says(%{stage: :ready}, _scene), do: "is ready to push, and waits for another"
  defp says(_mission, _scene), do: "goes behind the box"

  @doc "That the box may be at its goal, but not surely."
  @spec may_be(Push.t(), map()) :: String.t()
  def may_be(mission, scene) do
    "the box may be at its goal: #{metres(scene.far)} m +- #{metres(Estimate.margin(mission.box))} m"
  end

  defp metres(value), do: :erlang.float_to_binary(value * 1.0, decimals: 1)

  @doc "See `c:Robot.Mission.explain/1`."
  @spec explain(Push.t()) :: [{String.t(), String.t()}]
  def explain(%{box: nil}), do: [{"box", "not seen"}]

  def explain(%{box: box} = mission) do
    {pose, sd, sd_heading} = Estimate.best(box)

    [
      {"box",
       "#{metres(pose.x)},#{metres(pose.y)}, #{round(pose.heading * 180 / :math.pi())} degrees"},
      {"box, +-",
       "#{metres(2 * sd)} m, #{round(2 * sd_heading * 180 / :math.pi())} degrees, #{length(box.all)} ways to lie"},
      {"place", %{nil => "none", 1 => "left", -1 => "right", 0 => "alone"}[mission.side]},
      {"stage", "#{mission.stage}"}
    ]
  end

  @doc "See `c:Robot.Mission.layer/1`."
  @spec layer(Push.t()) :: list()
  def layer(%{box: nil} = mission), do: [{:points, "goal", [point(mission.goal, "goal")]}]

  def layer(%{box: box} = mission) do
    {pose, _sd, _sd_heading} = Estimate.best(box)
    [first | _] = corners = Box.corners(pose, mission.size)

    [
      {:points, "goal of the box", [point(mission.goal, "goal")]},
      {:polyline, "where the robots believe the box to be", corners ++ [first]}
    ] ++
      if(length(mission.trail) > 1,
        do: [{:polyline, "the way of the box", mission.trail}],
        else: []
      )
  end

  defp point({x, y}, label), do: {x, y, label}
end
