defmodule Course.Relay do
  @moduledoc """
  One robot drives after the other, by their names. A robot that is at its place says so in its claim, which goes to all five times
  a second; so a lost message only delays.
  """
  @behaviour Robot.Mission

  defmodule Claim do
    @moduledoc "Whether a robot has been at its place."
    defstruct there: false
    def valid?(%{there: there}), do: is_boolean(there)
  end

  # Until then it hears which robots there are.
  @listen_ms 2_000

  defstruct [:me, :since_ms, :fleet, phase: :idle, done: MapSet.new()]

  @impl Robot.Mission
  def option_table, do: []

  @impl Robot.Mission
  def commands, do: []

  @impl Robot.Mission
  def claims, do: {1, Claim}

  @impl Robot.Mission
  def init(robot, _options), do: {:idle, %__MODULE__{me: robot}, []}

  @impl Robot.Mission
  def handle({:command, :start}, mission),
    do: step(%__MODULE__{me: mission.me, phase: :wait}, [])

  def handle({:outcome, :place, 1}, mission), do: step(%{mission | phase: :there}, [])

  def handle({:tick, %{pose: %{}} = percept}, %{phase: phase} = mission) when phase != :idle do
    mission = %{mission | since_ms: mission.since_ms || percept.at_ms}

    mission =
      if percept.at_ms - mission.since_ms < @listen_ms, do: mission, else: run(mission, percept)

    there? = mission.phase == :there

    claim = %{
      phase: mission.phase,
      standing: mission.phase != :drive,
      formed: there?,
      there: there?
    }

    step(mission, goal(mission) ++ [{:claim, claim}])
  end

  def handle(_other, mission), do: step(mission, [])

  @impl Robot.Mission
  def halted(mission), do: %{mission | phase: :idle}

  defp run(mission, percept) do
    fleet = mission.fleet || Enum.sort([mission.me | Map.keys(percept.peers)])

    there = for {id, %{beat: %{claim: %{fields: %Claim{there: true}}}}} <- percept.peers, do: id

    mission = %{mission | fleet: fleet, done: MapSet.union(mission.done, MapSet.new(there))}
    before = Enum.take_while(fleet, &(&1 != mission.me))
    turn? = Enum.all?(before, &(&1 in mission.done))
    if mission.phase == :wait and turn?, do: %{mission | phase: :drive}, else: mission
  end

  defp goal(%{phase: :drive} = mission) do
    rank = Enum.find_index(mission.fleet, &(&1 == mission.me))
    x = 2 * rank - (length(mission.fleet) - 1)
    [{:goal, :place, {Robot.Behaviour.Goto, x: x, y: 3}}]
  end

  defp goal(_mission), do: [{:goal, :wait, {Robot.Behaviour.Stop, []}}]

  defp step(mission, effects), do: {mission.phase, mission, effects}
end
