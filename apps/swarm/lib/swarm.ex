defmodule Swarm do
  @moduledoc """
  The door for people: command robots from `iex`, on whichever node they are.

      Swarm.start()                        # all begin their mission: find, elect, follow
      Swarm.formation(:wedge, spacing: 1.2)
      Swarm.goto(:mag1, {2.0, 1.0})
      Swarm.follow(:mag2, :mag1)
      Swarm.status(:mag1)
      Swarm.estop()                        # everything stands, until
      Swarm.reset()

  A command to one robot answers `:ok`, which means accepted and not done, or an error:

  | error | means |
  |---|---|
  | `:unknown` | no robot of that name is in the directory |
  | `:no_answer` | it did not answer within 500 ms |
  | `:idle` | it has no mission that could take this command |
  | `:no_mission` | it was configured without one |

  A command to `:all` or to a list answers a map of these, by robot.
  """
  alias Robot.Command
  alias Swarm.{Directory, Formation}
  alias Swarm.Missions.Manual

  @answer_ms 500

  @type robot :: atom()
  @type error :: {:error, :unknown | :no_answer | :idle | :no_mission | (line :: String.t())}
  @type answer :: :ok | error()
  @type answers :: %{robot() => answer()}

  @doc "All robots that can be reached, sorted."
  @spec robots() :: [robot()]
  def robots, do: Directory.robots()

  @doc "Begins the mission of all robots."
  @spec start() :: answers()
  def start, do: start(:all)

  @doc "Begins the mission of one robot, of some, or of `:all`."
  @spec start(robot()) :: answer()
  @spec start([robot()] | :all) :: answers()
  def start(who), do: ask(who, :start)

  @doc "Stops what a robot is doing; it stands and waits for what comes next."
  @spec stop(robot()) :: answer()
  @spec stop([robot()] | :all) :: answers()
  def stop(who), do: ask(who, :stop)

  @doc """
  Sends a robot to a place, `{x, y}` or `{x, y, heading}` in the `map` frame.

      Swarm.goto(:mag1, {2.0, 1.0})
  """
  @spec goto(robot(), {number(), number()} | {number(), number(), number()}) :: answer()
  def goto(robot, {x, y}) when is_number(x) and is_number(y),
    do: manual(robot, {:goto, x * 1.0, y * 1.0, nil})

  def goto(robot, {x, y, heading}) when is_number(x) and is_number(y) and is_number(heading),
    do: manual(robot, {:goto, x * 1.0, y * 1.0, heading * 1.0})

  @doc "Lets a robot drive 1 m behind another."
  @spec follow(robot(), leader :: robot()) :: answer()
  def follow(robot, leader) when is_atom(leader) do
    if robot == leader,
      do: {:error, "#{robot} cannot follow itself"},
      else: manual(robot, {:follow_the_leader, leader})
  end

  @doc """
  Changes the shape that the fleet takes, as in `Swarm.Formation.new/2`.

      Swarm.formation(:line)
      Swarm.formation(:wedge, spacing: 1.2)
      Swarm.formation(:line, length: 5.0)
  """
  @spec formation(Formation.kind(), keyword()) :: answers() | {:error, line :: String.t()}
  def formation(kind, options \\ []) do
    robots = robots()

    with {:ok, {kind, spacing}} <- Formation.new(kind, sized(kind, options, length(robots))),
         do: ask(robots, {:formation, kind, spacing})
  end

  @doc """
  Tells a command in words (`Robot.Command`) to one robot, to a list, or to `:all`. A text that is
  wrong reaches nobody.

      Swarm.tell(:mag1, "goto:2.0:1.0")
      Swarm.tell([:mag2, :mag3], "followtheleader:mag1")
      Swarm.tell(:all, "start")
  """
  @spec tell(robot(), String.t()) :: answer()
  @spec tell([robot()] | :all, String.t()) :: answers() | {:error, line :: String.t()}
  def tell(who, text) do
    with {:ok, command} <- Command.parse(text, robots()), do: ask(who, command)
  end

  @doc "Stops all robots at once, until `reset/0`. Spreads from robot to robot, too."
  @spec estop() :: answers()
  def estop, do: ask(:all, :estop)

  @doc "Clears the emergency stop of all robots. Look where they would go, first."
  @spec reset() :: answers()
  def reset, do: ask(:all, :reset)

  @doc "What all robots are doing."
  @spec status() :: %{robot() => map() | error()}
  def status, do: Map.new(robots(), &{&1, status(&1)})

  @doc """
  What a robot is doing: all entries of its board (`Robot.Board`) with their ages in milliseconds.
  A robot of this node is not even asked.
  """
  @spec status(robot()) :: %{term() => {term(), age_ms :: integer()}} | error()
  def status(robot) do
    with :error <- Robot.Board.find(robot), {:ok, entries} <- ask(robot, :status) do
      entries
    else
      {:ok, board} -> Robot.Board.entries(board)
      error -> error
    end
  end

  @doc false
  @spec ask(robot() | [robot()] | :all, term()) :: term()
  def ask(:all, command), do: ask(robots(), command)

  # To all at once, so that a silent robot holds up nobody else's answer.
  def ask(robots, command) when is_list(robots) do
    deadline = System.monotonic_time(:millisecond) + @answer_ms
    asked = for robot <- robots, do: {robot, post(robot, command)}
    Map.new(asked, fn {robot, ref} -> {robot, answer(ref, deadline)} end)
  end

  def ask(robot, command) when is_atom(robot), do: ask([robot], command)[robot]

  defp manual(robot, command) do
    if Manual.command?(command),
      do: ask(robot, command),
      else: {:error, "cannot #{inspect(command)}: numbers from -1000000 to 1000000 are allowed"}
  end

  # An alias: an answer that comes too late finds no mailbox.
  defp post(robot, command) do
    case Directory.whereis(robot) do
      nil ->
        :unknown

      link ->
        ref = :erlang.alias([:reply])
        message = {:"$gen_cast", {:command, command, ref}}
        :erlang.send(link, message, [:nosuspend, :noconnect])
        ref
    end
  end

  defp answer(:unknown, _deadline), do: {:error, :unknown}

  defp answer(ref, deadline) do
    receive do
      {^ref, answer} -> answer
    after
      max(deadline - System.monotonic_time(:millisecond), 0) ->
        :erlang.unalias(ref)

        # It may have come just before the alias was gone.
        receive do
          {^ref, answer} -> answer
        after
          0 -> {:error, :no_answer}
        end
    end
  end

  defp sized(kind, options, robots) when kind in [:line, :triangle],
    do: Keyword.put_new(options, :robots, max(robots, 2))

  defp sized(_kind, options, _robots), do: options
end
