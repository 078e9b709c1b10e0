defmodule Tools.Replay.Moment do
  @moduledoc "Describes how the fleet of a replay stood at its last tick, and why a robot did what it did. Pure."
  alias Console.Cli.Format
  alias Tools.Replay.Options
  alias Lab.Replay.Kind
  alias Robot.Percept
  alias Hal.Pose
  alias Record.Recording.Topics
  alias Hal.Twist
  alias Robot.Wish

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
      if(doing.driving, do: ["drives #{driving(doing.driving)}"], else: [])
  end

  defp why(_name, %{before: nil}), do: ["Nothing had been decided yet."]

  defp why(name, run) do
    scene = Kind.scene(run.replay)

    with {:ok, id} <- chosen(name, scene),
         {at_ms, reasons} <- Kind.reasons(run.replay, run.before, run.tick, id) do
      explain(id, at_ms / 1000, reasons)
    else
      :no_leader -> ["There is no leader at this time."]
      _none -> ["#{name} decided nothing at this tick: it is dead, frozen, or not known yet."]
    end
  end

  defp chosen("leader", scene), do: if(scene.leader, do: {:ok, scene.leader}, else: :no_leader)

  # Names of robots that are recorded exist.
  defp chosen(name, _scene), do: {:ok, String.to_existing_atom(name)}

  # Explains to people why a robot did what it did at one tick (`t:Record.Replay.Member.reasons/0`). Pure.

  # The reasons of a robot at a time in seconds, line by line.
  defp explain(robot, at_s, reasons) do
    ["#{robot} at #{Format.decimals(at_s, 1)} s"] ++
      section("last order", order(reasons[:order])) ++
      section("perceived", percept(reasons.percept)) ++
      section("wishes, the strongest first", wishes(reasons.wishes)) ++
      section("gate", gate(reasons)) ++
      section("mission", mission(reasons)) ++
      section("did", effects(reasons.effects))
  end

  defp section(_title, []), do: []
  defp section(title, lines), do: ["#{title}:" | Enum.map(lines, &"  #{&1}")]

  # A run in lockstep has no givers, and its commands are its options.
  defp order(nil), do: []

  defp order(%{order: order, by: giver, at_ms: at_ms, obeyed?: obeyed?}) do
    by = if giver, do: " by #{giver}", else: ""
    result = %{true => ", obeyed", false => ", not obeyed", nil => ""}[obeyed?]
    ["#{Swarm.Order.words(order)}#{by} at #{Format.decimals(at_ms / 1000, 1)} s#{result}"]
  end

  defp percept(%Percept{} = percept) do
    [
      place(percept),
      sees(percept.detections),
      near(percept.sonar),
      bumpers(percept.bumpers)
      | for({id, peer} <- Enum.sort(percept.peers), do: hears(id, peer, percept.at_ms))
    ]
    |> Enum.reject(&is_nil/1)
  end

  defp place(%{pose: nil}), do: "does not know where it is"

  defp place(%{pose: pose, uncertainty: uncertainty}) do
    within =
      if uncertainty, do: ", within #{metres(uncertainty.radius)} in 95 of 100 cases", else: ""

    "estimates its pose as #{pose(pose)}#{within}"
  end

  defp sees(nil), do: "no fresh picture"
  defp sees(%{blobs: []}), do: "sees nothing of a known colour"

  defp sees(%{blobs: blobs}) do
    counted =
      blobs
      |> Enum.frequencies_by(& &1.colour)
      |> Enum.sort()
      |> Enum.map_join(", ", fn {name, count} -> "#{count} x #{name}" end)

    "sees #{counted}"
  end

  defp near([_ | _] = ranges), do: "nearest echo #{metres(Enum.min(ranges))}"
  defp near(_none), do: nil

  defp bumpers([]), do: nil
  defp bumpers(pressed), do: "bumpers pressed: #{Enum.join(pressed, ", ")}"

  defp hears(id, peer, at_ms) do
    "hears #{id}, #{peer.mode}, #{Format.decimals((at_ms - peer.at_ms) / 1_000, 1)} s ago at #{pose(peer.pose)}"
  end

  defp wishes([]), do: ["none"]

  defp wishes(wishes) do
    for {{%Wish{} = wish, weight}, n} <- Enum.with_index(wishes) do
      chosen = if n == 0, do: "  <- chosen", else: ""
      goal = if wish.goal, do: ", to reach #{point(wish.goal)}", else: ""
      "#{Format.decimals(weight, 2)}  #{wish.by}: #{twist(wish.twist)}#{goal}#{chosen}"
    end
  end

  defp gate(%{driving: nil}), do: ["has let nothing through yet"]

  defp gate(%{driving: %{twist: twist, limits: limits}}),
    do: ["lets #{twist(twist)} through, #{limited(limits) || "no limit"}"]

  # What a gate lets through, and what limits it.
  defp driving(%{twist: twist, limits: limits}),
    do: Enum.join([twist(twist) | List.wrap(limited(limits))], ", ")

  defp limited([]), do: nil
  defp limited(limits), do: "limited by #{Enum.join(limits, ", ")}"

  defp mission(%{mission: mission, before: before}) do
    for {label, text} <- mission do
      was = with {_label, old} when old != text <- List.keyfind(before, label, 0), do: old

      "#{String.pad_trailing(label, 8)} #{text}" <>
        if(is_binary(was), do: "  (before this tick: #{was})", else: "")
    end
  end

  defp effects(effects) do
    Enum.map(effects, fn
      {:drive, twist} -> "drive #{twist(twist)}"
      {:look, pan, _tilt} -> "look #{Format.decimals(pan * 180 / :math.pi(), 0)}° to the left"
      {:send, to, message} -> "send #{Topics.kind(message) || "a message"} to #{inspect(to)}"
      {:stage, name, facts} -> "tell people: #{name} #{inspect(facts)}"
    end)
  end

  defp twist(%Twist{linear: linear, turn: turn}),
    do: "#{Format.decimals(linear, 2)} m/s, #{Format.decimals(turn * 180 / :math.pi(), 0)}°/s"

  defp pose(%Pose{x: x, y: y, heading: heading}),
    do: "#{point({x, y})} facing #{Format.decimals(heading * 180 / :math.pi(), 0)}°"

  defp point({x, y}), do: "(#{Format.decimals(x, 2)}, #{Format.decimals(y, 2)})"
  defp metres(metres), do: "#{Format.decimals(metres, 2)} m"
end
