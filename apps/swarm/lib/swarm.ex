defmodule Swarm do
  @moduledoc """
  Commands from people to robots, on any of the connected nodes.

      iex> Swarm.goto(:mag1, {2.0, 1.0})
      :ok
      iex> Swarm.follow(:min1, :mag1)
      :ok
      iex> Swarm.start(formation: {:wedge, 1.2})
      :ok
      iex> Swarm.formation(:line, length: 4.0)
      :ok
      iex> Swarm.status()
      [#mag1 lead (0.02, -1.63, 90 deg) ±0.31 m, 0.00 m/s by track_blob, leader mag1, view 6, hears 5, age 12 ms, …]
      iex> Swarm.stop(:mag1)
      :ok
      iex> Swarm.estop()
      :ok

  Every command answers within half a second: `:ok`, which means that the responsible process of
  the robot has accepted it, not that it is done, or `{:error, line}`, which names what was wrong
  and what is allowed, or which part did not answer. For commands that stop, arm or reset a robot, `:ok`
  means that this has happened. Nothing raises, whatever the arguments. A command to several
  robots is `:ok` when all have accepted it; if some refuse, the error names them, and the others
  obey.

  Robots are atoms (`:mag1`), or their names as text. A robot obeys its last command: a robot that
  is sent somewhere leaves the group's mission, which goes on without it until the next start.
  """
  alias Robot.Command
  alias Swarm.{BehaviourRegistry, Commands, Directory, Formation, Replacement, Status}
  alias Swarm.Transport
  alias Swarm.EStop.Broadcaster
  alias Swarm.Status.Matrix
  alias Swarm.MissionRegistry.Text
  alias Swarm.Discovery.{Presence, Search}

  alias Swarm.Commands.StatusReport

  @type robot :: atom() | String.t()
  @typedoc "A mission by its name, also as text, or by its module (`Swarm.MissionRegistry`)."
  @type mission :: atom() | String.t()
  @type answer :: :ok | {:error, line :: String.t()}

  @doc """
  Drives a robot to a place in the map (metres), and turns it there to a heading (radians) if one
  is given.

      Swarm.goto(:mag1, {2.0, 1.0})
      Swarm.goto(:mag1, {2.0, 1.0, 1.57})
  """
  @spec goto(robot(), {number(), number()} | {number(), number(), number()} | Hal.Pose.t()) ::
          answer()
  def goto(robot, {x, y}), do: command(robot, {:goto, x, y, nil})
  def goto(robot, {x, y, heading}), do: command(robot, {:goto, x, y, heading})
  def goto(robot, %Hal.Pose{x: x, y: y, heading: heading}), do: goto(robot, {x, y, heading})

  def goto(_robot, place),
    do:
      {:error,
       "#{inspect(place)} is not a place; write {x, y} or {x, y, heading} in metres and radians"}

  @doc """
  Lets a robot follow another, one metre behind it, until the next command.

      Swarm.follow(:min1, :mag1)
  """
  @spec follow(robot(), leader :: robot()) :: answer()
  def follow(robot, leader) do
    with {:ok, [leader]} <- Commands.robots([leader]),
         do: command(robot, {:follow_the_leader, leader})
  end

  @doc """
  Starts the group's mission: that of each robot's file, else the first that is configured. Options: `robots`
  that take part (default `:all`), and those of the mission (`Swarm.MissionRegistry`).

      Swarm.start()
      Swarm.start(formation: {:diamond, 1.0}, robots: [:mag1, :mag2, :min1])

  A name instead of options starts that mission (`start/2`).
  """
  @spec start(keyword() | mission()) :: answer()
  def start(options \\ [])

  def start(mission) when (is_atom(mission) and mission != nil) or is_binary(mission),
    do: start(mission, [])

  def start(options), do: begin(nil, options)

  @doc """
  Starts the mission of this name (`Swarm.MissionRegistry`), or of this module, on all robots or on `robots:`; the other
  options are those of the mission. It replaces what the robots do.

      Swarm.start(:patrol)
      Swarm.start(:patrol, period: 90, robots: [:mag1, :mag2])
      Swarm.start(MyApp.Dance, [])
  """
  @spec start(mission(), keyword()) :: answer()
  def start(mission, options), do: begin(mission, options)

  defp begin(mission, options) do
    with {:ok, robots, request} <- Commands.start(mission, options),
         do: Commands.tell(robots, request)
  end

  @doc """
  Runs a behaviour that the build has named (`Swarm.BehaviourRegistry`) on a robot, a list of them, or `:all`, with its options.
  Each leaves the group's mission for it, until its next start.

      Swarm.run(:mag1, :corners, side: 2.0)
  """
  @spec run(robot() | [robot()] | :all, behaviour :: atom() | String.t(), keyword()) :: answer()
  def run(to, behaviour, options \\ []) do
    with {:ok, {module, options}} <- BehaviourRegistry.choose(behaviour, options),
         do: command(to, {:run, module, options})
  end

  @doc """
  Gives a robot, a list of them, or `:all` another mission of their release while they are under way: each that is on a
  mission is told to stand, its wheels come to rest, it changes, and goes on with the new one from its beginning; one that
  stands stays so, and begins with it at its next start. If the new one ends within 10 s, all robots of that node go
  back to what they had. `:ok` means that the robots have checked the order and are told to stand; their status says what
  came of it (`replaced`).

      Swarm.replace(:all, :flock)
      Swarm.replace([:mag1, :mag2], {:patrol, period: 60})

  A robot takes only what the fleet's key has signed (`Swarm.Replacement.Order`), and only if its file says
  `replace: true`, as simulated robots do. No code comes along. A restart of the robot returns to its release.
  """
  @spec replace(robot() | [robot()] | :all, mission() | {mission(), keyword()}) :: answer()
  def replace(to, mission) do
    with {:ok, robots} <- Commands.robots(to),
         {:ok, content} <- Replacement.order(robots, mission),
         do: Commands.tell(robots, {:replace, content})
  end

  @doc """
  Changes the formation of the running mission: `:ok` when all robots on a mission have it. The
  error names robots that do not answer or refuse, because one of them may be the leader; the
  others keep the new shape. Options: `spacing` (0.8 to 5 m, default 1), `length` of a line,
  `side` of a triangle.

      Swarm.formation(:wedge)
      Swarm.formation(:column, spacing: 1.5)
      Swarm.formation(:line, length: 4.0)
  """
  @spec formation(Formation.kind(), keyword()) :: answer()
  def formation(kind, options \\ []) do
    with {:ok, {kind, spacing}} <- Commands.formation(kind, options),
         {:ok, robots} <- Commands.robots(:all) do
      Commands.any(robots, {:formation, kind, spacing})
    end
  end

  @doc """
  Gives a command (`Robot.Command`), as text or as its term, to a robot, to a list of them, or to `:all`.

      Swarm.tell(:mag1, "goto:2.0:1.0")
      Swarm.tell([:mag1, :mag2], {:move, 0.2, 0.1})
      Swarm.tell(:all, "stop")
      Swarm.tell(:all, "start:patrol:period=90")
      Swarm.tell(:all, "replace:patrol:period=90")
      Swarm.tell(:mag1, "wander")

  `"ping"` is a question: a robot answers with its name, how long it has been up, and its state
  and for how long it has been in it.

      Swarm.tell(:mag1, "ping")
      {:ok, "mag1 on mag1@convoy, up for 12 min 3 s, follow for 34 s"}

  `subscribe`, `unsubscribe`, `position` and `blob` are commands between robots, and are refused:
  every heartbeat carries what they would bring.
  """
  @spec tell(robot() | [robot()] | :all, String.t() | Command.t() | {:replace, String.t()}) ::
          answer() | {:ok, line :: String.t()}
  def tell(to, "replace:" <> mission), do: replace(to, mission)
  def tell(to, {:replace, mission}), do: replace(to, mission)

  def tell(to, text) when is_binary(text) do
    with {:ok, command} <- Command.parse(text, Transport.robots()), do: command(to, command)
  end

  def tell(to, term) do
    with {:ok, command} <- Command.check(term, Transport.robots()), do: command(to, command)
  end

  @doc """
  The status of all robots, one line each in `iex`; for those that do not answer, from their rows
  on the blackboard. Each has its numbered view of the robots present, and the robots that it
  hears (`Swarm.Status`).
  """
  @spec status() :: [Status.t()]
  def status, do: StatusReport.all()

  @doc """
  The status of one robot; if it does not answer, from its row on the blackboard, however old.

      Swarm.status(:mag1)
      Swarm.status(:mag1).rejected
  """
  @spec status(robot()) :: Status.t() | {:error, String.t()}
  def status(robot), do: StatusReport.one(robot)

  @doc """
  Has robots write what they know of their last minute as a recording, on their own machines, for `mix replay`: what they were told and by
  what they decided. Robots whose files have `incidents:` do it, too, at an emergency stop, a fault or a crash.

      Swarm.keep(:mag1)
      {:ok, "mag1: what it knows of the last 60 s is being written to /var/lib/convoy/incidents"}

  The answer says that it is being written; the robot's log says in which file, or why in none.
  """
  @spec keep(:all | [robot()] | robot()) :: {:ok, line :: String.t()} | answer()
  def keep(robots \\ :all), do: tell(robots, :keep)

  @doc """
  What a robot's sonars measured last, wherever it is: for each where it is on the body (its pose there), and how far the
  nearest thing is in metres. The error says why it is not known.

      Swarm.sonar(:mag1)
  """
  @spec sonar(robot()) :: {:ok, [{Hal.Pose.t(), float()}]} | {:error, line :: String.t()}
  def sonar(robot) do
    with {:ok, [id]} <- Commands.robots([robot]),
         do: ask(id, :sonar) || {:error, "#{id} does not answer"}
  end

  @doc """
  What a robot's mission draws over the map (`t:Robot.Mission.layer/0`), wherever it is; `[]` of one that draws nothing. The error says
  why it is not known, such as that it is more than is sent at once.

      Swarm.layer(:mag1)
  """
  @spec layer(robot()) :: {:ok, Robot.Mission.layer()} | {:error, line :: String.t()}
  def layer(robot) do
    with {:ok, [id]} <- Commands.robots([robot]),
         do: ask(id, :layer) || {:error, "#{id} does not answer"}
  end

  @doc "Which robot hears which, as a table in `iex`."
  @spec matrix() :: Matrix.t()
  def matrix, do: Matrix.new(status())

  @doc """
  The robots that match the options, sorted; without options, all. Options: `service`, `profile`,
  `state`, `mission`, `robot`, `node` (a name, or a list of names), `battery` (volts,
  `{24.0, 28.0}` or `24..28`), `calibrated` (`true`), each also a function of one argument;
  `max_age_ms` of their rows (10,000).

      Swarm.find(service: :camera)
      Swarm.find(profile: :atrv_mini, battery: {24.0, 28.0})
      Swarm.find(state: [:follow, :lead], battery: &(&1 > 24))
  """
  @spec find(keyword()) :: [atom()] | {:error, line :: String.t()}
  def find(template \\ []), do: Search.robots(template)

  @doc """
  Notifies the calling process, or the given one, of robots that join and leave, by messages
  `{:swarm, {:join, robot, about}}` (`Swarm.Discovery.RobotInfo`) and
  `{:swarm, {:leave, robot, reason}}` (`:left`, `:nodedown`, or `:silent` for 2 s). Returns the
  robots that are present now.

      {:ok, robots} = Swarm.subscribe()
  """
  @spec subscribe(pid()) :: {:ok, [atom()]} | {:error, line :: String.t()}
  def subscribe(pid \\ self()), do: Presence.subscribe(pid)

  @doc "Ends the subscription."
  @spec unsubscribe(pid()) :: :ok | {:error, line :: String.t()}
  def unsubscribe(pid \\ self()), do: Presence.unsubscribe(pid)

  @doc """
  Stops all robots, one, or a list of them, whatever they are doing: no mission is asked. `:ok`
  when the wheels of each have been told to stand and its mission or order has ended; it stands
  until the next command. The next `start/1` uses the formation that was last requested.

      Swarm.stop()
      Swarm.stop(:mag1)
  """
  @spec stop(robot() | [robot()] | :all) :: answer()
  def stop(robots \\ :all), do: command(robots, :stop)

  @doc """
  Emergency stop: all robots stop and are held until `reset/0`. It is sent at once by all
  available ways, and repeated for a second; each robot that hears of it tells the others, so that
  it also reaches those that this node does not reach. `:ok` when all robots that are known here
  have answered that they are held; an error where none is known, because none has answered then, and where this
  machine has no network (`Mesh.fault/0`), although the robots here are held then.
  The hardware's own emergency stop stays the last resort: this one is software.
  """
  @spec estop() :: answer()
  def estop do
    call = Broadcaster.call()
    :ok = Broadcaster.sound(call)

    case Commands.robots(:all) do
      {:ok, robots} ->
        with :ok <- Commands.tell(robots, {:estop, call}), do: reached(robots)

      {:error, _none} ->
        {:error, "the stop was sent, but no robot is known here to be held by it#{why_not()}"}
    end
  end

  # Those beyond a network that is gone are not known here.
  defp reached(robots) do
    if Mesh.fault(),
      do:
        {:error,
         "#{Enum.join(robots, ", ")} held, but robots elsewhere are not reached#{why_not()}"},
      else: :ok
  end

  defp why_not, do: if(line = Mesh.fault(), do: " (no network: #{line})", else: "")

  @doc """
  Releases the emergency stop. The stop ended the missions and orders of the robots: they stand
  until the next command, for instance `start/0`. `:ok` when these have ended, and no robot is
  held any more; a robot whose mission or executive hangs does not answer, and stays held. Does
  nothing to robots that are not held.
  """
  @spec reset() :: answer()
  def reset do
    with :ok <- Commands.Client.timely() do
      Broadcaster.quiet(:all)
      command(:all, :reset)
    end
  end

  @doc """
  Tells all robots that move only in the presence of a person (`presence:` of their files) that one looks after them now. Pages, pads
  and `bin/presence` say so several times a second; a program that says so without a person takes the rule away. As an
  order, it counts from when it was given.

      Swarm.present()
  """
  @spec present() :: answer()
  def present do
    case Directory.attended() do
      [] -> :ok
      robots -> Commands.tell(robots, :present)
    end
  end

  @doc """
  Lets the wheels of a robot turn (of a list, of `:all`). Real robots come up disarmed: a person who
  arms one should stand beside it and check where it would go. Refused, with what is missing, by a
  base whose conversions are not set, by one whose line was lost while its wheels turned
  (`acknowledge/1`), and while the emergency stop holds the robot.

      Swarm.arm(:mag1)
  """
  @spec arm(robot() | [robot()] | :all) :: answer()
  def arm(robots), do: command(robots, :arm)

  @doc """
  Stops all robots, one, or a list of them, ends their missions and orders, and keeps their wheels
  from turning until `arm/1`. `:ok` when all of this has happened. As every stop it is obeyed
  however late it arrives.

      Swarm.disarm(:mag1)
  """
  @spec disarm(robot() | [robot()] | :all) :: answer()
  def disarm(robots \\ :all), do: command(robots, :disarm)

  @doc """
  Confirms that a person has checked why a robot's line was lost while its wheels turned: it is
  disarmed then, and may be armed. Does nothing to other robots.

      Swarm.acknowledge(:mag1)
  """
  @spec acknowledge(robot() | [robot()] | :all) :: answer()
  def acknowledge(robots), do: command(robots, :acknowledge)

  @doc """
  Calls a function whose orders count as given at `at_us` (`System.monotonic_time/1` of this node, in microseconds), and
  returns what it returns. For orders that have waited, in a queue or on a connection: they are refused when they are older
  than half a second, and by robots that were stopped since. A stop is carried out at any age.

      Swarm.given(heard_us, fn -> Swarm.goto(:mag1, {2.0, 1.0}) end)
      {:error, "given 0.8 s ago and not carried out: at most 0.5 s are allowed; repeat it"}
  """
  @spec given(at_us :: integer(), (... -> result)) :: result when result: term()
  defdelegate given(at_us, fun), to: Commands.Client

  @doc """
  Calls a function whose orders are given by `giver`, as people name it, and returns what it returns. The robots log and
  record who gave an order. A giver is a text of at most 60 printable bytes (ASCII); anything else is left out, and the order is
  given by this node, as without this call. A program that calls from elsewhere (`:erpc`), and has no function of this
  node, says `{module, function, arguments}`.

      Swarm.by("page 127.0.0.1:5123", fn -> Swarm.goto(:mag1, {2.0, 1.0}) end)
      Swarm.by("notebook of ann", {Swarm, :goto, [:mag1, {2.0, 1.0}]})
  """
  @spec by(giver :: String.t(), (... -> result) | {module(), atom(), [term()]}) ::
          result | term()
        when result: term()
  defdelegate by(giver, fun), to: Commands.Client

  @doc false
  @spec ask(atom(), term()) :: term()
  def ask(robot, request), do: Commands.Client.ask([robot], request)[robot]

  # Commands for the robot itself, not for its mission.
  defp command(to, request) when request in [:reset, :arm, :disarm, :acknowledge] do
    with {:ok, robots} <- Commands.robots(to), do: Commands.tell(robots, request)
  end

  defp command(to, request) do
    with {:ok, robots} <- Commands.robots(to),
         {:ok, request} <- Text.request(request, length(robots)),
         {:ok, request} <- Swarm.Order.check(request),
         do: Commands.tell(robots, request)
  end
end
