defmodule Course.LineUp do
  @moduledoc "All robots stand in a row through (0, 0) along x, by their names, 1 m apart."
  @behaviour Robot.Mission

  # A robot that nobody has heard for so long is not there.
  @gone_ms 2_000

  defstruct [:me, phase: :idle]

  @impl Robot.Mission
  def option_table, do: []

  @impl Robot.Mission
  def commands, do: []

  @impl Robot.Mission
  def init(robot, _options), do: {:idle, %__MODULE__{me: robot}, []}

  @impl Robot.Mission
  def handle({:command, :start}, mission), do: step(%{mission | phase: :drive}, [])

  def handle({:outcome, {:place, _rank}, 1}, %{phase: :drive} = mission),
    do: step(%{mission | phase: :there}, [])

  def handle({:tick, %{pose: %{}} = percept}, %{phase: phase} = mission) when phase != :idle do
    present = for {id, peer} <- percept.peers, percept.at_ms - peer.at_ms < @gone_ms, do: id
    row = Enum.sort([mission.me | present])
    rank = Enum.find_index(row, &(&1 == mission.me))
    x = rank - (length(row) - 1) / 2
    claim = %{phase: phase, standing: phase == :there, formed: phase == :there}
    # Another row is another goal: the tag says which.
    goal = {:goal, {:place, {rank, length(row)}}, {Robot.Behaviour.Goto, x: x, y: 0}}
    step(mission, [goal, {:claim, claim}])
  end

  def handle(_other, mission), do: step(mission, [])

  @impl Robot.Mission
  def halted(mission), do: %{mission | phase: :idle}

  defp step(mission, effects), do: {mission.phase, mission, effects}
end
