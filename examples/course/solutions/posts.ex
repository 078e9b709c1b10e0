defmodule Course.Posts do
  @moduledoc """
  Keeps three places occupied. The post of a robot goes with its claim, so that one that is free goes to the first robot by name
  that has none; robots with a post keep it.
  """
  @behaviour Robot.Mission

  @posts [{-4, 3}, {4, 3}, {0, -4}]
  @gone_ms 2_000
  # For so long after the start it only listens: what others have is known then.
  @listen_ms 1_000

  defmodule Claim do
    @moduledoc "Which post a robot has, 1 to 3; 0: none."
    defstruct post: 0
    def valid?(%{post: post}), do: post in 0..3
  end

  defstruct [:me, :since_ms, phase: :idle, post: 0]

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
    do: step(%{mission | phase: :wait, since_ms: nil, post: 0}, [])

  def handle({:outcome, {:post, post}, 1}, %{post: post} = mission),
    do: step(%{mission | phase: :there}, [])

  def handle({:tick, %{pose: %{}} = percept}, %{phase: phase} = mission) when phase != :idle do
    mission = %{mission | since_ms: mission.since_ms || percept.at_ms}
    held = held(percept)

    mission =
      if percept.at_ms - mission.since_ms < @listen_ms, do: mission, else: choose(mission, held)

    claim = %{
      phase: mission.phase,
      standing: mission.phase != :drive,
      formed: mission.phase != :drive,
      post: mission.post
    }

    step(mission, goal(mission) ++ [{:claim, claim}])
  end

  def handle(_other, mission), do: step(mission, [])

  @impl Robot.Mission
  def halted(mission), do: %{mission | phase: :idle, post: 0}

  # Which post each living robot has, as it says.
  defp held(percept) do
    for {id, peer} <- percept.peers,
        percept.at_ms - peer.at_ms < @gone_ms,
        %{claim: %{fields: %Claim{post: post}}} <- [peer.beat],
        do: {id, post}
  end

  # Of two that have taken one post at once, the first by name has it.
  defp choose(%{post: post, me: me} = mission, held) when post > 0 do
    if Enum.any?(held, fn {id, other} -> other == post and id < me end),
      do: %{mission | post: 0, phase: :wait},
      else: mission
  end

  defp choose(mission, held) do
    free = Enum.to_list(1..3) -- Enum.map(held, &elem(&1, 1))
    waiting = Enum.sort([mission.me | for({id, 0} <- held, do: id)])
    rank = Enum.find_index(waiting, &(&1 == mission.me))

    case Enum.at(free, rank) do
      nil -> mission
      post -> %{mission | post: post, phase: :drive}
    end
  end

  defp goal(%{post: 0}), do: [{:goal, :wait, {Robot.Behaviour.Stop, []}}]

  defp goal(%{post: post}) do
    {x, y} = Enum.at(@posts, post - 1)
    [{:goal, {:post, post}, {Robot.Behaviour.Goto, x: x, y: y}}]
  end

  defp step(mission, effects), do: {mission.phase, mission, effects}
end
