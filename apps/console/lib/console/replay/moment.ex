defmodule Console.Replay.Moment do
  @moduledoc "Describes how the fleet of a replay stood at its last tick, and why a robot did what it did. Pure."
  alias Console.Cli.Format
  alias Console.Replay.{Options, Why}
  alias Sim.{Replay, Trial}
  alias Swarm.Member

  @typedoc "The replay after its last tick and before it, and that tick."
  @type run :: %{
          :replay => Replay.t(),
          :before => Replay.t() | nil,
          :tick => Sim.Recording.tick() | nil,
          optional(atom()) => term()
        }

  @doc "What the options ask about this moment, line by line."
  @spec lines(Options.t(), run()) :: [String.t()]
  def lines(options, run) do
    shown = if options.at_s || options.robot, do: fleet(options.robot, run), else: []
    shown ++ if(options.why, do: why(options.why, run), else: [])
  end

  defp fleet(name, run) do
    scene = Trial.scene(Replay.trial(run.replay))
    robots = for robot <- scene.robots, name in [nil, Atom.to_string(robot.id)], do: robot.id
    [Format.status(scene) | Enum.flat_map(robots, &Format.one(scene, &1))]
  end

  defp why(_who, %{before: nil}), do: ["Nothing had been decided yet."]

  defp why(who, %{before: before, tick: {_end_ms, entries}} = run) do
    case robot(who, Trial.scene(Replay.trial(run.replay))) do
      nil ->
        ["There is no leader at this time."]

      id ->
        inputs = for {:step, ^id, input, _effects} <- entries, do: input
        reasons(id, Trial.robot(Replay.trial(before), id), inputs)
    end
  end

  # Readings and messages came to the robot before it decided; then came the gate's next step.
  defp reasons(id, member, inputs) do
    case Enum.split_while(inputs, &(not match?({:tick, _at_ms}, &1))) do
      {first, [{:tick, at_ms} | _] = decided} when member != nil ->
        member = Enum.reduce(first, member, &elem(Member.step(&2, &1), 0))
        Why.lines(id, at_ms / 1000, Swarm.Replay.reasons(member, Enum.take(decided, 2)))

      _dead_or_frozen ->
        ["#{id} decided nothing at this tick: it is dead, or frozen."]
    end
  end

  defp robot("leader", scene), do: scene.leader

  defp robot(name, scene),
    do: Enum.find_value(scene.robots, &(Atom.to_string(&1.id) == name && &1.id))
end
