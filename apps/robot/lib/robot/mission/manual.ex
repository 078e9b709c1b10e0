defmodule Robot.Mission.Manual do
  @moduledoc """
  Runs a person's commands on one robot (`Robot.Command`), one command at a time. The
  robot leaves the group's mission for it, and returns to that with the next start.
  Pure. A mission does not carry out `stop`: the pilot ends this mission like any other.

  In its heartbeats the robot stays `:idle`, so that no group waits for it, and names the robot
  that it follows, so that a command that would close a circle of followers can be refused.

  Its phase is the command's name, then `:done`; for `find_blob`, `:found` or `:not_found`. A `goto` that the robot gives up
  (`Robot.Behaviour.Goto`) ends as `:given_up`: the stage of this name, and the claim's `blocked_by`, say why; from a door, or
  where no robot gets past it, it goes aside (`Nav.PassingPlace`). One that ends
  where the robot is not sure to be, by the uncertainty of its pose, ends as `:done`, and the claim's `says` says so; a robot that
  does not know where it is on its floor plan (`Robot.Percept.astray/1`) has given up.

  The camera looks ahead, or where a person has it look (`look`), whatever the robot does besides, unless its behaviour needs it.

  A robot that is followed need not do anything: its heartbeats are the position updates that a
  subscription asks for, so robots refuse a subscription. A follower keeps 1 m behind
  its leader, stands when it has not heard it for a second, and continues when it hears it again.
  """
  alias Hal.{Pose, Twist}
  alias Robot.{Command, Percept}
  alias Robot.Behaviour.Blocker
  alias Nav.{Grid, PassingPlace, Reach}

  @behaviour Robot.Mission

  @behind 1.0
  @silent_ms 1_000
  # A robot that gives up goes so much farther than it must (metres) for a place where it is less in the way.
  @aside 1.0
  # The phases in which no command is carried out.
  @over [:ready, :done, :given_up, :found, :not_found]
  # It has not surely arrived at a place if it may be this far from there (metres).
  @unsure 0.5

  @enforce_keys [:me]
  defstruct @enforce_keys ++ [count: 0, command: nil, result: nil, why: nil, pan: 0.0]

  @type t :: %__MODULE__{
          me: atom(),
          count: non_neg_integer(),
          command: Command.t() | nil,
          result: integer() | nil,
          why: String.t() | nil,
          pan: float()
        }

  @doc """
  A robot's claim as people are shown it: its heartbeats say `:idle` while it carries out a command, which is `:manual` here,
  and `mission` is the module of its mission.

      iex> alias Robot.Mission.Manual
      iex> for phase <- [:goto, :done], do: Manual.shown({Manual, phase}, %{phase: :idle})
      [%{phase: :manual}, %{phase: :idle}]
      iex> Manual.shown({:a_mission, :lead}, %{phase: :lead})
      %{phase: :lead, mission: :a_mission}
  """
  @spec shown(:idle | {module(), atom()}, claim :: map()) :: map()
  def shown({__MODULE__, phase}, claim) when phase not in @over,
    do: Map.put(claim, :phase, :manual)

  def shown({module, _phase}, claim) when module != __MODULE__,
    do: Map.put(claim, :mission, module)

  def shown(_state, claim), do: claim

  @impl Robot.Mission
  def init(robot, _options),
    do: {:ready, %__MODULE__{me: robot}, [{:claim, %{phase: :idle, standing: true}}]}

  # What it does besides goes on.
  @impl Robot.Mission
  def handle({:command, {:look, pan}}, mission) when is_number(pan),
    do: result(%{mission | pan: pan}, [{:look, pan}])

  def handle({:command, command}, mission) do
    with {_module, _options} = goal <- goal(command, nil), :ok <- Robot.Behaviour.check(goal) do
      mission = %{mission | command: command, count: mission.count + 1, result: nil, why: nil}
      goal = {:goal, {:command, mission.count}, goal}
      result(mission, [goal, {:look, mission.pan}, {:claim, claim(mission)}])
    else
      _no_command -> result(mission, [])
    end
  end

  # The robot's status reports the outcome of a command by its phase.
  def handle({:outcome, {:command, count}, outcome}, %{count: count} = mission),
    do: result(%{mission | result: outcome}, [{:claim, %{phase: :idle, standing: true}}])

  # What is in the way is known from the percept that comes right after the outcome.
  def handle(
        {:tick, %Percept{pose: %Pose{}} = percept},
        %{command: {:goto, x, y, _heading}, result: failed, why: nil} = mission
      )
      when failed in [0, 2] do
    why = blocker(failed, percept, {x, y})
    gone = {:stage, :given_up, %{x: x, y: y, blocked_by: why}}
    claim = {:claim, %{phase: :idle, standing: true, blocked_by: why}}
    result(%{mission | why: why}, [gone, claim | aside(percept, {x, y}, mission.count)])
  end

  def handle(
        {:tick, %Percept{uncertainty: %{place: {_state, why}}}},
        %{command: {:goto, x, y, _heading}, result: 1, why: nil} = mission
      ) do
    gone = {:stage, :given_up, %{x: x, y: y, blocked_by: why}}
    claim = {:claim, %{phase: :idle, standing: true, blocked_by: why}}
    result(%{mission | result: 2, why: why}, [gone, claim])
  end

  def handle(
        {:tick, %Percept{uncertainty: %{radius: radius}}},
        %{command: {:goto, _x, _y, _heading}, result: 1, why: nil} = mission
      )
      when radius > @unsure do
    says =
      "there by its own estimate, which may be #{:erlang.float_to_binary(radius, decimals: 1)} m off"

    claim = {:claim, %{phase: :idle, standing: true, says: says}}
    result(%{mission | why: says}, [claim])
  end

  # The followed robot moves, and its heartbeats may end.
  def handle({:tick, percept}, %{command: {:follow_the_leader, _leader} = command} = mission),
    do: result(mission, [{:goal, {:command, mission.count}, goal(command, percept)}])

  def handle(_event, mission), do: result(mission, [])

  # A person's commands for this robot alone, of which a formation is none.
  @impl Robot.Mission
  def commands, do: []

  defp result(%{command: nil} = mission, effects), do: {:ready, mission, effects}

  defp result(%{result: nil} = mission, effects),
    do: {phase(mission.command), mission, effects}

  defp result(%{command: {:find_blob, _colour}} = mission, effects),
    do: {if(mission.result == 1, do: :found, else: :not_found), mission, effects}

  defp result(%{command: {:goto, _x, _y, _heading}, result: failed} = mission, effects)
       when failed in [0, 2],
       do: {:given_up, mission, effects}

  defp result(mission, effects), do: {:done, mission, effects}

  # It does not stay in a door, or in another place where no robot gets past.
  defp aside(%{grid: nil}, _goal, _count), do: []

  defp aside(%{grid: grid, pose: pose, profile: %{radius: radius}}, goal, count) do
    at = Pose.point(pose)

    with false <- PassingPlace.passes?(grid, at, radius, radius),
         {_metres, {x, y}} <- PassingPlace.nearest(grid, {at, radius}, {goal, radius}, [], @aside) do
      [{:goal, {:aside, count}, {Robot.Behaviour.Goto, x: x, y: y}}]
    else
      _passes_or_none -> []
    end
  end

  # Walls first, then what stands on the first stretch of the way round them.
  defp blocker(failed, %{grid: grid, pose: pose, profile: profile} = percept, goal) do
    case Reach.check(grid, Pose.point(pose), goal, profile.radius) do
      {:error, :no_way} -> Blocker.words(:no_way)
      {:error, _place} -> "a wall at its goal"
      :ok when failed == 0 -> Blocker.words(:no_way)
      :ok -> percept |> Blocker.find(next(grid, pose, goal, profile.radius)) |> Blocker.words()
    end
  end

  defp next(nil, _pose, goal, _radius), do: goal

  defp next(grid, pose, goal, radius),
    do: hd(Grid.Way.find(grid, Pose.point(pose), goal, Reach.room(radius)) || [goal])

  defp phase(command) when is_atom(command), do: command
  defp phase(command), do: elem(command, 0)

  defp claim(%{command: {:follow_the_leader, leader}}), do: %{phase: :idle, leader: leader}
  defp claim(_command), do: %{phase: :idle, standing: false}

  defp goal({:move, linear, turn}, _percept),
    do: {Robot.Behaviour.Move, linear: linear, turn: turn}

  # A person who steers repeats this command: it ends by itself when the repetitions do.
  defp goal({:move, linear, turn, for_s}, _percept),
    do: {Robot.Behaviour.Move, linear: linear, turn: turn, for_ms: for_s * 1_000}

  defp goal({:goto, x, y, nil}, _percept), do: {Robot.Behaviour.Goto, x: x, y: y}

  defp goal({:goto, x, y, heading}, _percept),
    do: {Robot.Behaviour.Goto, x: x, y: y, heading: heading}

  defp goal({:follow, %Pose{} = place}, _percept), do: {Robot.Behaviour.Follow, target: place}
  defp goal({:run, module, options}, _percept), do: {module, options}
  defp goal(:wander, _percept), do: {Robot.Behaviour.Wander, []}
  defp goal(:rest, _percept), do: {Robot.Behaviour.Rest, []}
  defp goal({:square, nil}, _percept), do: {Robot.Behaviour.Square, []}
  defp goal({:square, side}, _percept), do: {Robot.Behaviour.Square, side: side}
  defp goal({:find_blob, colour}, _percept), do: {Robot.Behaviour.FindBlob, colour: colour}

  # Stands until the next percept contains the followed robot.
  defp goal({:follow_the_leader, _leader}, nil), do: {Robot.Behaviour.Stop, []}

  defp goal({:follow_the_leader, leader}, %Percept{peers: peers, at_ms: now_ms}) do
    case peers do
      %{^leader => %{at_ms: at_ms} = peer} when now_ms - at_ms < @silent_ms -> behind(peer)
      _silent -> {Robot.Behaviour.Stop, []}
    end
  end

  # A coloured object that is carried before its camera leads it, and others follow.
  defp goal(:lead, _percept), do: {Robot.Behaviour.TrackBlob, []}
  defp goal(_unknown, nil), do: nil

  defp behind(%{pose: pose, twist: %Twist{linear: linear}}) do
    velocity = {linear * :math.cos(pose.heading), linear * :math.sin(pose.heading)}

    {Robot.Behaviour.Follow,
     target: Pose.compose(pose, Pose.new(-@behind, 0)), velocity: velocity}
  end
end
