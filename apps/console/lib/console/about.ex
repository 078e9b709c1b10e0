defmodule Console.About do
  @moduledoc false
  # Describes what a robot knows and does, for the page: the wishes, what limits it, its way, its devices, what its
  # sonars and its camera see. Of a robot of this node it is read from its board, so that no process of the robot is asked.
  alias Hal.{Json, Odometry, Pose}
  alias Robot.{Board, Names, Percept}
  alias Robot.Control.Controller
  alias Lab.Trial.Setup
  alias Swarm.{Member, Status}
  alias Swarm.Status.{Sight, Words}

  # Readings that are older tell nothing of now.
  @recent_ms 1_000

  @typedoc """
  `wishes` are all behaviours that wished, with their weights, the chosen one first; `way` are the corners of the way that
  it takes, and `pose` where it believes to be: `[x, y]` in metres.
  """
  @type t :: %{atom() => term()}

  @doc "For the page; `nil` for a robot that is not on this node, or is dead."
  @spec of(atom()) :: t() | nil
  def of(robot) do
    with {:ok, board} <- Board.find(robot) do
      entries = Board.entries(board)
      doing = recent(entries, :doing) || %{by: nil, weights: [], way: [], limits: [], fault: nil}

      %{
        by: doing.by,
        wishes: wishes(doing.weights),
        way: points(doing.way),
        pose: entries |> recent(:pose) |> point(),
        fault: doing.fault,
        limits: doing.limits ++ (recent(entries, :driving) || %{limits: []}).limits,
        power: recent(entries, :power, 60_000),
        offline: for({{:health, device}, {{:offline, _reason}, _age}} <- entries, do: device),
        estop: Board.latched?(board),
        sonar: sonar(robot, recent(entries, :sonar)),
        seen: seen(recent(entries, :detections)),
        camera: Names.whereis(robot, :view) != nil,
        pictures: nil,
        notes: claimed(recent(entries, :mission, :infinity))
      }
      |> Map.merge(
        sight(robot, entries, (recent(entries, :release, :infinity) || %{mission: nil}).mission)
      )
      |> Map.merge(wheels(recent(entries, :odometry)))
    else
      :error -> nil
    end
  end

  @doc "The same of a robot in lockstep, by what it perceived last; it has no devices and no camera pictures to look at."
  @spec of_member(Member.t()) :: t() | nil
  def of_member(%Member{} = member) do
    controller = Member.role(member, :executive).controller

    with %Percept{} = percept <- Controller.percept(controller) do
      {id, mission} = {Member.id(member), member.lockstep.config.mission}
      weights = Controller.weights(controller)

      %{
        by: List.first(for {by, _weight} <- weights, do: by),
        wishes: wishes(weights),
        way: points(Controller.way(controller)),
        pose: point(percept.pose),
        fault: Controller.fault(controller),
        limits: Controller.limits(controller) ++ (percept.driving || %{limits: []}).limits,
        power: percept.power,
        offline: [],
        estop: Member.held(member) != nil,
        sonar: sonar(id, percept.sonar),
        seen: nil,
        camera: false,
        pictures: nil,
        notes: claimed(%{claim: Member.claim(member)})
      }
      |> Map.merge(sight(id, now(percept), mission))
      |> Map.merge(wheels(percept.odometry))
    end
  end

  @doc """
  The same of a robot anywhere, from its status, and its sonars, which it is asked for; the pictures of its camera do not leave
  its node, and `pictures` says so. `notes` are what its status remarks, as in `iex`.
  """
  @spec of_status(Status.t()) :: t()
  def of_status(%Status{} = status) do
    here? = Names.whereis(status.robot, :view) != nil

    %{
      by: status.by,
      wishes: wishes(status.weights),
      way: points(status.way),
      pose: point(status.pose),
      fault: status.fault,
      speed: status.speed,
      turn: nil,
      limits: status.limits,
      power: status.power,
      offline: for({device, {:offline, _reason}} <- status.health, do: device),
      estop: status.estop,
      sonar: asked(status),
      seen: nil,
      camera: here?,
      pictures:
        if(not here? and is_map_key(status.health, :camera),
          do: "do not leave #{status.node}: look from there"
        ),
      looks: Sight.words(status.head),
      sees: Sight.words(status.sees),
      notes: notes(status)
    }
  end

  # Only one that answers is asked, within half a second.
  defp asked(%{from: :robot, robot: robot}) do
    with {:ok, ranges} <- Swarm.sonar(robot),
         do: for({at, range} <- ranges, do: [at.x, at.y, at.heading, range]),
         else: (_not_known -> [])
  end

  defp asked(_row), do: []

  # What it perceived last, as entries of a board.
  defp now(percept), do: %{ptz: {percept.ptz, 0}, detections: {percept.detections, 0}}

  defp sight(robot, entries, mission) do
    config = %{
      id: robot,
      profile: Setup.profile(robot),
      colours: Sim.World.colours(),
      mission: mission
    }

    head = entries |> Sight.head() |> Sight.words()
    %{looks: head, sees: config |> Sight.of(entries) |> Sight.words()}
  end

  defp wishes(weights), do: for({by, weight} <- weights, do: [by, weight])
  defp points(places), do: for({x, y} <- places, do: [x, y])
  defp point(nil), do: nil
  defp point(%Pose{x: x, y: y}), do: [x, y]

  # What its mission says to people.
  defp claimed(%{claim: claim}) do
    blocked_by = claim[:blocked_by]

    for text <- [blocked_by && "blocked by #{blocked_by}", claim[:says]],
        is_binary(text),
        do: text
  end

  defp claimed(_none), do: []

  defp notes(status) do
    Enum.filter(
      [
        Status.arming(status),
        status.blocked_by && "blocked by #{status.blocked_by}",
        Words.of(:says, status),
        status.network && "no network (#{status.network})",
        status.from == :row && "does not answer; this is from the blackboard"
      ],
      & &1
    )
  end

  @doc "What is known of a robot, as JSON."
  @spec json(atom(), map()) :: String.t()
  def json(robot, about), do: about |> Map.merge(%{t: "about", id: robot}) |> Json.encode!()

  @doc "A new picture of its camera as JPEG, or why there is none."
  @spec picture(atom()) :: {:ok, binary()} | {:error, line :: String.t()}
  def picture(robot), do: Swarm.Camera.snapshot(robot)

  # What they report, not what they are told.
  defp wheels(%Odometry{twist: twist}), do: %{speed: twist.linear, turn: twist.turn}
  defp wheels(nil), do: %{speed: nil, turn: nil}

  defp recent(entries, key, ms \\ @recent_ms) do
    case entries do
      %{^key => {value, age_ms}} when age_ms <= ms -> value
      _none_or_old -> nil
    end
  end

  # Where each sonar is on the body, where it looks, and how far the nearest thing is: metres and radians.
  defp sonar(_robot, nil), do: []

  defp sonar(robot, ranges) do
    for {%Pose{} = at, range} <- Enum.zip(Setup.profile(robot).sonars, ranges),
        do: [at.x, at.y, at.heading, range]
  end

  defp seen(%{blobs: [first | _] = blobs}) do
    boxes = for blob <- blobs, do: [blob.colour, blob.left, blob.top, blob.right, blob.bottom]
    %{width: first.width, height: first.height, boxes: boxes}
  end

  defp seen(_nothing), do: nil
end
