defmodule Console.Cli.Format do
  @moduledoc "Formats events and figures of a fleet for people. Pure."

  # What is done to a run by its script (`Lab.Trial.Interventions`).
  @done %{
    landmark_removed: "the landmark is taken away",
    estop: "somebody presses the emergency stop of ROBOT",
    reset: "somebody clears the emergency stop of every robot",
    radio_cut: "the radio is cut",
    radio_whole: "the radio is whole again",
    displaced: "ROBOT is lifted to another place",
    not_displaced: "ROBOT cannot be put there: somebody stands in the way",
    placed: "somebody puts OBJECT elsewhere",
    not_placed: "OBJECT cannot be put there: there is no room"
  }

  @doc """
  One stage as a line of text.

      iex> Console.Cli.Format.stage(%{stage: :elected, at_s: 12.34, robot: :mag2, epoch: 3, size_ppm: 41_000})
      "   12.3 s  elected         mag2 leads (epoch 3, landmark 4.1 % of its picture)"
      iex> Console.Cli.Format.stage(%{stage: :crashed, at_s: 3.0, robot: :mag1, crash: "(RuntimeError) boom, lib/gather.ex:42"})
      "    3.0 s  crashed         mag1: (RuntimeError) boom, lib/gather.ex:42"
      iex> Console.Cli.Format.stage(%{stage: :search, at_s: 0.0})
      "    0.0 s  search          every robot looks around for the landmark"
      iex> Console.Cli.Format.stage(%{stage: :landmark_removed, at_s: 35.0, robot: nil})
      "   35.0 s  landmark_removed  the landmark is taken away"
  """
  @spec stage(Sim.Scene.stage()) :: String.t()
  def stage(%{clock: clock, line: line}), do: "#{clock}  #{line}"

  def stage(%{stage: name, at_s: at_s} = stage) do
    String.pad_leading(decimals(at_s, 1), 7) <>
      " s  " <> String.pad_trailing("#{name}", 14) <> "  " <> meaning(stage)
  end

  @doc """
  The meaning of a stage, without its time and name.

      iex> Console.Cli.Format.meaning(%{stage: :killed, at_s: 40, robot: :mag1})
      "mag1 is dead"
      iex> Console.Cli.Format.meaning(%{stage: :disarmed, at_s: 40, robot: :mag1})
      "mag1's wheels were disarmed (its line, or a person), and its mission has ended"
      iex> Console.Cli.Format.meaning(%{stage: :formed, at_s: 40, robot: :mag1, followers: 3, as: :turned, asked: "line 2.0"})
      "mag1 and its 3 followers say that they stand in their places, turned: no room for line 2.0"
      iex> Console.Cli.Format.meaning(%{stage: :cannot_form, at_s: 40, robot: :mag1, asked: "line 2.0", followers: 4})
      "where mag1 stands there is no room for line 2.0, nor for 4 followers in any other shape"
  """
  @spec meaning(Sim.Scene.stage()) :: String.t()
  # A mission's own words.
  def meaning(%{says: says, robot: robot}), do: "#{robot} #{says}"
  def meaning(%{stage: :crashed, robot: robot, crash: crash}), do: "#{robot}: #{crash}"

  def meaning(%{stage: :disarmed, robot: robot}),
    do: "#{robot}'s wheels were disarmed (its line, or a person), and its mission has ended"

  def meaning(%{stage: :hangs, robot: robot, role: role, for_s: for_s}),
    do: "#{robot}: its #{role}, for #{for_s} s"

  def meaning(%{stage: :search}), do: "every robot looks around for the landmark"
  def meaning(%{stage: :elected} = stage), do: "#{stage.robot} leads" <> why(stage)

  def meaning(%{stage: :formed, as: shape, asked: asked} = stage),
    do: "#{places(stage)}, #{shape(shape)}: no room for #{asked}"

  def meaning(%{stage: :cannot_form, robot: robot, asked: asked, followers: count}) do
    "where #{robot} stands there is no room for #{asked}, nor for #{count(count, "follower")} in any other shape"
  end

  def meaning(%{stage: :given_up, robot: robot, x: x, y: y, blocked_by: why}),
    do: "#{robot} gives up its way to #{x},#{y}: blocked by #{why}"

  def meaning(%{stage: :estop_holds, by: by}),
    do: "emergency stop#{called(by)}: held until a reset"

  def meaning(%{stage: :estop_over}), do: "no robot is held any more; they stand until a start"

  def meaning(%{stage: :formed} = stage), do: places(stage)
  def meaning(%{stage: :landmark_moved}), do: "the landmark starts to move"
  def meaning(%{stage: :killed, robot: robot}), do: "#{robot} is dead"

  def meaning(%{stage: :world_lost}),
    do: "the world has ended; robots stand still, it is started again"

  def meaning(%{stage: :world_back}),
    do:
      "the world goes on where it was; robots whose wheels fell silent stand, idle, until a start"

  def meaning(%{stage: :lost} = stage), do: "#{subject(stage)} has lost the landmark"

  def meaning(%{stage: :refused, robot: robot, from: from, epoch: epoch}),
    do: "#{robot} does not believe #{from}, which says epoch #{epoch}"

  def meaning(%{stage: :told, command: command} = stage),
    do: "#{stage.robot || "every robot"} is told #{told(command)}"

  def meaning(%{stage: :order_refused, command: command, why: why}),
    do: "not #{told(command)}: #{why}"

  def meaning(%{stage: :radio_loss, share: share}),
    do: "#{decimals(share * 100, 0)} % of the messages are lost from now on"

  def meaning(%{stage: stage, for_s: for_s, robot: robot}),
    do: "#{robot} is #{stage} for #{decimals(for_s, 1)} s"

  def meaning(%{stage: stage, robot: robot} = told) when is_map_key(@done, stage),
    do:
      @done[stage]
      |> String.replace("ROBOT", "#{robot}")
      |> String.replace("OBJECT", "#{told[:object]}")

  def meaning(%{stage: name}), do: name |> to_string() |> String.replace("_", " ")

  @doc """
  The emergency stop that holds robots, in one line for every view; `nil` if none does.

      iex> stop = %{held: [:mag1, :mag2], of: 3, since_ms: 2_000, by: ["base"]}
      iex> robots = [%{id: :mag3, alive: true}]
      iex> Console.Cli.Format.estop(%Sim.Scene{at_ms: 14_000, map: nil, robots: robots, estop: stop})
      "EMERGENCY STOP for 12 s, called by base: 2 of 3 robots held (not mag3); reset frees them"
  """
  @spec estop(Sim.Scene.t()) :: String.t() | nil
  def estop(%{estop: nil}), do: nil

  def estop(%{estop: stop} = scene) do
    held = "#{length(stop.held)} of #{count(stop.of, "robot")} held#{free(scene.robots, stop)}"
    since = duration(scene.at_ms - stop.since_ms)
    "EMERGENCY STOP for #{since}#{called(stop.by)}: #{held}; reset frees them"
  end

  defp called([]), do: ""
  defp called(["this program"]), do: ", called here"
  defp called(by), do: ", called by #{Enum.join(by, ", ")}"

  # Those that still drive are the news.
  defp free(robots, stop) do
    case for(%{alive: true, id: id} <- robots, id not in stop.held, do: id) do
      [] -> ""
      free -> " (not #{Enum.join(free, ", ")})"
    end
  end

  defp duration(ms) when ms < 120_000, do: "#{div(ms, 1_000)} s"
  defp duration(ms), do: "#{div(ms, 60_000)} min"

  defp told({:start, module, _options}), do: "to start #{Swarm.MissionRegistry.name(module)}"
  defp told({:formation, kind, spacing}), do: "to form a #{kind} with #{decimals(spacing, 1)} m"
  defp told(command), do: to_string(command)

  @doc """
  A number with a fixed count of decimals, never "-0.0".

      iex> Console.Cli.Format.decimals(2, 1)
      "2.0"
      iex> Console.Cli.Format.decimals(-0.001, 2)
      "0.00"
  """
  @spec decimals(number(), 0..15) :: String.t()
  def decimals(number, count) do
    text = :erlang.float_to_binary(number * 1.0, decimals: count)
    if text =~ ~r/^-0\.?0*$/, do: String.trim_leading(text, "-"), else: text
  end

  @doc """
  A time in ms as seconds with one decimal.

      iex> Console.Cli.Format.seconds(12_340)
      "12.3 s"
  """
  @spec seconds(number()) :: String.t()
  def seconds(ms), do: "#{decimals(ms / 1000, 1)} s"

  @doc """
  A count with its noun.

      iex> {Console.Cli.Format.count(1, "robot"), Console.Cli.Format.count(6, "robot"), Console.Cli.Format.count(0, "collision")}
      {"1 robot", "6 robots", "no collisions"}
  """
  @spec count(non_neg_integer(), String.t()) :: String.t()
  def count(0, noun), do: "no #{noun}s"
  def count(1, noun), do: "1 #{noun}"
  def count(n, noun), do: "#{n} #{noun}s"

  @doc "The fleet at this moment in one line."
  @spec status(Sim.Scene.t()) :: String.t()
  def status(scene) do
    living = Enum.filter(scene.robots, & &1.alive)
    doing = "#{count(length(living), "robot")}, #{doing(scene, living)}"
    String.pad_leading(decimals(scene.at_ms / 1000, 1), 7) <> " s  #{estop(scene) || doing}"
  end

  defp doing(%{mission: mission} = scene, living) when mission in [nil, "landmark"] do
    sight = Enum.count(living, &(&1.size_ppm != nil))
    "#{sight} with the landmark in sight, #{leader(scene)}"
  end

  # Of other missions the phases that their robots are in.
  defp doing(%{mission: mission}, living) do
    phases = living |> Enum.frequencies_by(& &1.state) |> Enum.sort()
    "#{mission}: #{Enum.map_join(phases, ", ", fn {phase, count} -> "#{count} #{phase}" end)}"
  end

  @doc "All robots, each in a line of its own."
  @spec everybody(Sim.Scene.t()) :: [String.t()]
  def everybody(scene), do: List.wrap(estop(scene)) ++ Enum.map(scene.robots, &robot/1)

  @doc "One robot in one line."
  @spec one(Sim.Scene.t(), atom()) :: [String.t()]
  def one(scene, name), do: for(robot <- scene.robots, robot.id == name, do: robot(robot))

  defp robot(%{alive: false} = robot), do: "#{robot.id}: dead, at #{pose(robot.pose)}"

  defp robot(robot) do
    slot =
      case Sim.Scene.slot_error(robot) do
        nil -> ""
        metres -> ", #{decimals(metres, 2)} m off its place"
      end

    sight =
      case robot.size_ppm do
        nil -> ", does not see the landmark"
        ppm -> ", the landmark fills #{decimals(ppm / 10_000, 1)} % of its picture"
      end

    doubt =
      if robot.uncertainty, do: ", #{within(robot.uncertainty)} by its own estimate", else: ""

    role = if robot.leader?, do: " (leader)", else: ""
    "#{robot.id}: #{state(robot)}#{role} at #{pose(robot.pose)}#{doubt}#{slot}#{sight}"
  end

  defp state(%{state: :estop}), do: "held by the emergency stop"
  defp state(%{state: :unsure}), do: "not sure of its place,"
  defp state(%{state: state}), do: state

  @doc """
  The uncertainty of a robot's position, in metres.

      iex> Console.Cli.Format.within(0.618)
      "±0.62 m"
  """
  @spec within(number()) :: String.t()
  def within(metres), do: "±#{decimals(metres, 2)} m"

  @doc """
  Breaks a line between words into rows of at most `width` characters; all rows but the first are
  indented.

      iex> Console.Cli.Format.rows("mag1: lead at 1,2, sees it", 14)
      ["mag1: lead at", "    1,2, sees", "    it"]
  """
  @spec rows(String.t(), pos_integer()) :: [String.t()]
  def rows(line, width) do
    if String.length(line) <= width, do: [line], else: broken(line, width)
  end

  defp broken(line, width) do
    [start] = Regex.run(~r/^ */, line)

    line
    |> String.split(" ", trim: true)
    |> Enum.reduce([start], fn word, [row | rows] ->
      longer = if String.trim(row) == "", do: row <> word, else: row <> " " <> word

      if String.length(longer) <= width or String.trim(row) == "",
        do: [longer | rows],
        else: ["    " <> word, row | rows]
    end)
    |> Enum.reverse()
  end

  defp pose(pose) do
    degrees = decimals(pose.heading * 180 / :math.pi(), 0)
    "#{decimals(pose.x, 2)},#{decimals(pose.y, 2)} heading #{degrees} degrees"
  end

  defp leader(%{leader: nil}), do: "no leader"
  defp leader(%{error: nil} = scene), do: "#{scene.leader} leads"

  defp leader(%{error: {mean, max}} = scene) do
    word = if scene.formed?, do: ", formed", else: ""
    "#{scene.leader} leads#{word}, error #{decimals(mean, 2)} m (at most #{decimals(max, 2)} m)"
  end

  defp why(stage) do
    parts =
      [Map.get(stage, :epoch) && "epoch #{stage.epoch}"] ++
        [
          Map.get(stage, :size_ppm) &&
            "landmark #{decimals(stage.size_ppm / 10_000, 1)} % of its picture"
        ]

    case Enum.filter(parts, & &1) do
      [] -> ""
      parts -> " (#{Enum.join(parts, ", ")})"
    end
  end

  # How many robots it is said of; a mission of one's own need not count them.
  defp places(%{robot: robot, followers: 0}), do: "#{robot} says that it stands in its place"

  defp places(%{robot: robot, followers: followers}),
    do: "#{robot} and its #{count(followers, "follower")} say that they stand in their places"

  defp places(%{robot: robot}), do: "#{robot} says that all stand in their places"
  defp places(_fleet), do: "all say that they stand in their places"

  defp shape(:turned), do: "turned"
  defp shape(:closer), do: "closer together"
  defp shape(:column), do: "in a column along its leader's way"
  defp shape(:cluster), do: "in the nearest free places"

  defp subject(stage), do: Map.get(stage, :robot) || "the leader"
end
