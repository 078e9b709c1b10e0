defmodule Tools.Replay.Moment do
  @moduledoc "Describes how the fleet of a replay stood at its last tick, and why a robot did what it did. Pure."
  alias Console.Cli.Format
  alias Tools.Replay.{Options, Why}
  alias Lab.Replay.Kind

  @typedoc "The replay after its last tick and before it, and that tick."
  @type run :: %{
          :replay => Kind.t(),
          :before => Kind.t() | nil,
          :tick => Kind.tick() | nil,
          optional(atom()) => term()
        }

  @doc "What the options ask about this moment of robots with these names, line by line."
  @spec lines(Options.t(), run(), names :: [String.t()]) :: [String.t()]
  def lines(options, run, names) do
    names = for name <- names, options.robot in [nil, name], do: name
    shown = if options.at_s || options.robot, do: fleet(names, run), else: []
    shown ++ if(options.why, do: why(options.why, run), else: [])
  end

  defp fleet(names, run) do
    scene = Kind.scene(run.replay)
    believed = if scene.map, do: [], else: ["Poses are those that the robots believe to have."]
    [Format.status(scene) | Enum.map(names, &robot(&1, scene, run.replay))] ++ believed
  end

  defp robot(name, scene, replay) do
    case Enum.find(scene.robots, &(Atom.to_string(&1.id) == name)) do
      nil -> "#{name}: nothing is known of it yet"
      robot -> Enum.join(words(robot, scene, Kind.doing(replay, robot.id)), "; ")
    end
  end

  # A scene without a map has no truth either.
  defp words(robot, scene, doing) do
    silent? = scene.map == nil and not robot.alive

    if(silent?,
      do: ["#{robot.id}: nothing is recorded of it since #{Format.seconds(doing.known_ms)}"],
      else: Format.one(scene, robot.id)
    ) ++
      if(doing.mission, do: ["runs #{inspect(doing.mission)}"], else: []) ++
      if(doing.driving, do: ["drives #{Why.driving(doing.driving)}"], else: [])
  end

  defp why(_name, %{before: nil}), do: ["Nothing had been decided yet."]

  defp why(name, run) do
    scene = Kind.scene(run.replay)

    with {:ok, id} <- chosen(name, scene),
         {at_ms, reasons} <- Kind.reasons(run.replay, run.before, run.tick, id) do
      Why.lines(id, at_ms / 1000, reasons)
    else
      :no_leader -> ["There is no leader at this time."]
      _none -> ["#{name} decided nothing at this tick: it is dead, frozen, or not known yet."]
    end
  end

  defp chosen("leader", scene), do: if(scene.leader, do: {:ok, scene.leader}, else: :no_leader)

  # Names of robots that are recorded exist.
  defp chosen(name, _scene), do: {:ok, String.to_existing_atom(name)}
end
