defmodule Gather do
  @moduledoc "All robots stand on a circle round a place, and face it. Options: `at` (`{x, y}`), `radius` (metres)."
  @behaviour Robot.Mission

  @place {:tuple, [{:number, -100, 100, "m"}, {:number, -100, 100, "m"}], "{x, y} in metres"}
  # A robot that nobody has heard for so long is not there.
  @gone_ms 2_000

  defstruct [:me, :at, :radius, phase: :idle, arrived: %{}]

  @impl Robot.Mission
  def option_table,
    do: [at: [@place, default: {0.0, 0.0}], radius: [{:number, 0.5, 10, "m"}, default: 1.5]]

  @impl Robot.Mission
  def messages, do: {1, arrived: [there: [:boolean, required: true]]}

  @impl Robot.Mission
  def commands, do: []

  @impl Robot.Mission
  def init(robot, options),
    do: {:idle, struct!(__MODULE__, [me: robot] ++ options), []}

  @impl Robot.Mission
  def handle({:command, :start}, mission), do: step(%{mission | phase: :drive}, [])

  def handle({:outcome, :place, 1}, %{phase: :drive} = mission),
    do: step(%{mission | phase: :face}, [])

  def handle({:outcome, :face, 1}, %{phase: :face} = mission),
    do: step(%{mission | phase: :there}, [{:tell, :all, :arrived, there: true}])

  def handle({:message, %{kind: :arrived, from: robot, body: body}}, mission),
    do: step(put_in(mission.arrived[robot], body[:there]), [])

  def handle({:tick, %{pose: %{}} = percept}, %{phase: phase} = mission) when phase != :idle do
    present = for {id, peer} <- percept.peers, percept.at_ms - peer.at_ms < @gone_ms, do: id
    fleet = Enum.sort([mission.me | present])
    mission = %{mission | arrived: Map.take(mission.arrived, present)}
    count = Enum.count(mission.arrived, fn {_id, there?} -> there? end)

    says = if phase == :there, do: "there, with #{count} others"
    claim = %{phase: phase, standing: phase == :there, formed: phase == :there, says: says}
    step(mission, [goal(mission, fleet), {:claim, claim}])
  end

  def handle(_other, mission), do: step(mission, [])

  # What a stop leaves: robots wait for the next start.
  @impl Robot.Mission
  def halted(mission), do: %{mission | phase: :idle, arrived: %{}}

  defp step(mission, effects), do: {mission.phase, mission, effects}

  defp goal(%{phase: :face, at: {x, y}}, _fleet), do: {:goal, :face, {Gather.Face, x: x, y: y}}
  defp goal(%{phase: :there}, _fleet), do: {:goal, :stand, {Robot.Behaviour.Stop, []}}

  defp goal(%{at: {x, y}} = mission, fleet) do
    rank = Enum.find_index(fleet, &(&1 == mission.me))
    angle = 2 * :math.pi() * rank / length(fleet)
    x = x + mission.radius * :math.cos(angle)
    y = y + mission.radius * :math.sin(angle)
    {:goal, :place, {Robot.Behaviour.Goto, x: x, y: y}}
  end
end
