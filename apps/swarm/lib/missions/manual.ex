defmodule Missions.Manual do
  @moduledoc """
  One robot does what a person tells it (`Robot.Command`), one command at a time (R16, R31 to R36):
  a robot leaves the group's mission for it, and comes back with the next start. Pure. `stop` is no
  command of a mission's: the pilot ends this one like any other.

  In its heartbeats the robot stays `:idle`, so that no group waits for it, and names whom it
  follows, so that nobody can close a circle of followers.

  Its phase is the command's name, then `:done`; of `find_blob`, `:found` or `:not_found`.

  Whoever is followed need not do anything: its heartbeats are the position updates that a
  subscription asked for (R27, R35), so a person who asks for one is told so, and nothing changes. A follower keeps 1 m behind its leader, stands when it has
  not heard it for a second, and goes on when it hears it again (R34).
  """
  alias Hal.{Pose, Twist}
  alias Robot.{Behaviour, Command, Percept}
  alias Swarm.Formation
  alias Swarm.Message.WireTypes

  @behaviour Robot.Mission

  @behind 1.0
  @silent_ms 1_000
  # Farther than any floor, and faster than any robot: a slip of the finger.
  @farthest 10_000
  @fastest 10

  @enforce_keys [:me]
  defstruct @enforce_keys ++ [count: 0, command: nil, result: nil]

  @type t :: %__MODULE__{
          me: atom(),
          count: non_neg_integer(),
          command: Command.t() | nil,
          result: integer() | nil
        }

  @typedoc "What a person may ask of a robot: a command for it alone, or one for its group."
  @type order ::
          Command.t() | {:start, keyword()} | {:formation, Formation.kind(), spacing :: float()}

  @doc """
  A command that a person gave, with numbers that make sense, or one line that says which does not.

      iex> Missions.Manual.check({:goto, 1, 2.0, nil})
      {:ok, {:goto, 1.0, 2.0, nil}}
      iex> Missions.Manual.check({:goto, :far, 2.0, nil})
      {:error, "goto cannot take :far: a number from -10000 to 10000 is allowed"}
      iex> Missions.Manual.check({:move, 99, 0})
      {:error, "move cannot take 99: a number from -10 to 10 is allowed"}
  """
  @spec check(term()) :: {:ok, order()} | {:error, line :: String.t()}
  def check({:goto, x, y, nil}), do: numbers(:goto, [x, y], @farthest, &{:goto, &1, &2, nil})

  def check({:goto, x, y, h}),
    do: numbers(:goto, [x, y, h], @farthest, &{:goto, &1, &2, turn(&3)})

  def check({:move, v, w}), do: numbers(:move, [v, w], @fastest, &{:move, &1, &2})

  def check({:follow, %Pose{x: x, y: y, heading: h}}),
    do: numbers(:follow, [x, y, h], @farthest, &{:follow, Pose.new(&1, &2, &3)})

  # What robots tell each other travels in their heartbeats and rounds. A person who says it would be believed by
  # nobody, and the robot shall not leave its mission for nothing.
  def check({word, _robot}) when word in [:subscribe, :unsubscribe],
    do:
      {:error,
       "#{word} is for no robot: each tells its pose to all, five times a second; " <>
         "followtheleader:NAME follows one"}

  def check({:position, _pose}),
    do:
      {:error,
       "position is for robots only, which tell their own; goto:X:Y:THETA sends one there"}

  def check({:blob, _pose, _size, _found?}),
    do: {:error, "blob is for robots only, which report what they see; findblob lets one look"}

  def check(command) do
    if known?(command),
      do: {:ok, command},
      else: {:error, "#{brief(command)} is not a command; those of Robot.Command are allowed"}
  end

  defp known?(word) when word in [:stop, :lead, :start, :ping], do: true
  defp known?({:follow_the_leader, robot}), do: WireTypes.name?(robot)
  defp known?({:find_blob, colour}), do: colour == nil or is_binary(colour)
  defp known?({:formation, kind, spacing}), do: Formation.valid?({kind, spacing})
  defp known?({:start, options}), do: Keyword.keyword?(options)
  defp known?(_other), do: false

  defp brief(term), do: inspect(term, limit: 5, printable_limit: 40)

  defp turn(heading), do: Pose.wrap(heading)

  # NaN and the infinities are not numbers of this language, so they cannot come.
  defp numbers(word, list, most, build) do
    case Enum.reject(list, &(is_number(&1) and abs(&1) <= most)) do
      [] ->
        {:ok, apply(build, Enum.map(list, &(&1 * 1.0)))}

      [wrong | _] ->
        {:error,
         "#{word} cannot take #{inspect(wrong)}: a number from -#{most} to #{most} is allowed"}
    end
  end

  @doc """
  Whether a robot may follow another: not itself, and nobody who follows it, over however many.
  `leaders` says whom each robot follows.

      iex> Missions.Manual.follow(:min1, :mag1, %{mag1: nil})
      :ok
      iex> Missions.Manual.follow(:mag1, :mag1, %{})
      {:error, "mag1 cannot follow itself"}
      iex> Missions.Manual.follow(:min1, :mag1, %{mag1: :mag2, mag2: :min1})
      {:error, "min1 cannot follow mag1, who follows min1 (mag1 -> mag2 -> min1)"}
  """
  @spec follow(atom(), atom(), %{atom() => atom() | nil}) :: :ok | {:error, String.t()}
  def follow(me, me, _leaders), do: {:error, "#{me} cannot follow itself"}

  def follow(me, leader, leaders) do
    chain = chain([leader], leaders)

    if me in chain,
      do:
        {:error, "#{me} cannot follow #{leader}, who follows #{me} (#{Enum.join(chain, " -> ")})"},
      else: :ok
  end

  defp chain([last | _] = seen, leaders) do
    case leaders[last] do
      nil -> Enum.reverse(seen)
      next -> if next in seen, do: Enum.reverse(seen), else: chain([next | seen], leaders)
    end
  end

  @impl Robot.Mission
  def init(robot, _options),
    do: {:ready, %__MODULE__{me: robot}, [{:claim, %{phase: :idle, standing: true}}]}

  @impl Robot.Mission
  def handle({:command, command}, mission) do
    mission = %{mission | command: command, count: mission.count + 1, result: nil}
    goal = {:goal, {:command, mission.count}, goal(command, nil)}
    result(mission, [goal, {:look, 0.0}, {:claim, claim(mission)}])
  end

  # How a command ended, by its outcome (R12), is known to whoever asks for the robot's status.
  def handle({:outcome, {:command, count}, outcome}, %{count: count} = mission),
    do: result(%{mission | result: outcome}, [{:claim, %{phase: :idle, standing: true}}])

  # The one followed moves, and may fall silent.
  def handle({:tick, percept}, %{command: {:follow_the_leader, _leader} = command} = mission),
    do: result(mission, [{:goal, {:command, mission.count}, goal(command, percept)}])

  def handle(_event, mission), do: result(mission, [])

  defp result(%{command: nil} = mission, effects), do: {:ready, mission, effects}

  defp result(%{result: nil} = mission, effects),
    do: {phase(mission.command), mission, effects}

  defp result(%{command: {:find_blob, _colour}} = mission, effects),
    do: {if(mission.result == 1, do: :found, else: :not_found), mission, effects}

  defp result(mission, effects), do: {:done, mission, effects}

  defp phase(command) when is_atom(command), do: command
  defp phase(command), do: elem(command, 0)

  defp claim(%{command: {:follow_the_leader, leader}}), do: %{phase: :idle, leader: leader}
  defp claim(_command), do: %{phase: :idle, standing: false}

  defp goal({:move, linear, turn}, _percept), do: {Behaviour.Move, linear: linear, turn: turn}
  defp goal({:goto, x, y, nil}, _percept), do: {Behaviour.Goto, x: x, y: y}
  defp goal({:goto, x, y, heading}, _percept), do: {Behaviour.Goto, x: x, y: y, heading: heading}
  defp goal({:follow, %Pose{} = place}, _percept), do: {Behaviour.Follow, target: place}
  defp goal({:find_blob, colour}, _percept), do: {Behaviour.FindBlob, colour: colour}

  # Until the next percept shows where that one is.
  defp goal({:follow_the_leader, _leader}, nil), do: {Behaviour.Stop, []}

  defp goal({:follow_the_leader, leader}, %Percept{peers: peers, at_ms: now_ms}) do
    case peers do
      %{^leader => %{at_ms: at_ms} = peer} when now_ms - at_ms < @silent_ms -> behind(peer)
      _silent -> {Behaviour.Stop, []}
    end
  end

  # Whatever is carried before its camera leads it, and others follow (R35).
  defp goal(:lead, _percept), do: {Behaviour.TrackBlob, []}

  defp behind(%{pose: pose, twist: %Twist{linear: linear}}) do
    velocity = {linear * :math.cos(pose.heading), linear * :math.sin(pose.heading)}
    {Behaviour.Follow, target: Pose.compose(pose, Pose.new(-@behind, 0)), velocity: velocity}
  end
end
