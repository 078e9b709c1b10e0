defmodule Console.About do
  @moduledoc """
  Describes what a robot knows and does, for the page: the wishes, what limits it, its way, its devices, what its
  sonars and its camera see. Of a robot of this node it is read from its board, so that no process of the robot is asked.
  """
  alias Hal.{Json, Odometry, Pose}
  alias Robot.{Board, Names, Percept}
  alias Robot.Control.Controller
  alias Robot.Percept.Snapshot
  alias Swarm.{Member, Status}
  alias Swarm.Status.{Sight, Words}
  alias Vision.Mark

  @typedoc """
  `wishes` are all behaviours that wished, with their weights, the chosen one first; `way` are the corners of the way that
  it takes, and `pose` and `heading` where it believes to be: `[x, y]` in metres, radians; `notes` are what its status remarks, as in `iex`.
  """
  @type t :: %{atom() => term()}

  @doc "For the page; `nil` for a robot that is not on this node, or is dead."
  @spec of(atom()) :: t() | nil
  def of(robot) do
    with {:ok, board} <- Board.find(robot),
         entries = Board.entries(board),
         {%{mission: mission, profile: profile}, _age_ms} <- entries[:release] do
      # No driver is asked for its words here.
      config = %{
        id: robot,
        profile: profile,
        start: Pose.new(0, 0),
        mission: mission,
        drive: {nil, []},
        ptz: {nil, []},
        camera: {nil, []}
      }

      config
      |> by_board(entries, board)
      |> Map.merge(%{
        seen: seen(fresh(entries)[:detections]),
        camera: Names.whereis(robot, :view) != nil
      })
    else
      _no_board_or_not_yet -> nil
    end
  end

  @doc "The same of a robot in lockstep, by what it perceived last; it has no devices and no camera pictures to look at."
  @spec of_member(Member.t()) :: t() | nil
  def of_member(%Member{lockstep: %{config: config, board: board}} = member) do
    with %Percept{at_ms: now_ms} <- Controller.percept(Member.role(member, :executive).controller) do
      entries = for {key, {value, at_ms}} <- board, into: %{}, do: {key, {value, now_ms - at_ms}}
      by_board(config, entries, board)
    end
  end

  defp by_board(config, entries, board) do
    fresh = fresh(entries)
    status = config |> Map.put(:colours, Sim.World.colours()) |> Status.of_board(fresh, board)
    turn = with {%Odometry{twist: twist}, _age_ms} <- fresh[:odometry], do: twist.turn

    layer =
      with {%{layer: layer}, _age_ms} <- fresh[:mission], do: layer(layer), else: (_idle -> [])

    more = config.profile |> hears(fresh) |> Map.merge(%{turn: turn, layer: layer})
    status |> told() |> Map.merge(more)
  end

  # Readings that are older tell nothing of now.
  @recent_ms 1_000
  @readings [:odometry, :sonar, :scan, :ptz, :detections, :doing, :driving, :pose, :uncertainty]
  @power_ms 60_000

  defp fresh(entries) do
    :maps.filter(
      fn
        key, {_value, age_ms} when key in @readings -> age_ms <= @recent_ms
        :power, {_value, age_ms} -> age_ms <= @power_ms
        _key, _entry -> true
      end,
      entries
    )
  end

  @doc """
  The same of a robot anywhere, from its status, and its sonars, which it is asked for; the pictures of its camera do not leave
  its node, and `pictures` says so.
  """
  @spec of_status(Status.t()) :: t()
  def of_status(%Status{} = status) do
    here? = Names.whereis(status.robot, :view) != nil
    there? = not here? and is_map_key(status.health, :camera)

    status
    |> told()
    |> Map.merge(%{
      sonar: asked(status),
      camera: here?,
      pictures: if(there?, do: "do not leave #{status.node}: look from there")
    })
  end

  @doc "The same with what its mission draws, as it was asked for (`Swarm.layer/1`), or with why that is not known."
  @spec with_layer(t(), {:ok, Robot.Mission.layer()} | {:error, line :: String.t()}) :: t()
  def with_layer(about, {:ok, layer}), do: %{about | layer: layer(layer)}
  def with_layer(about, {:error, line}), do: %{about | notes: about.notes ++ [line]}

  @doc "The same where nothing is known but what is put into it."
  @spec nothing() :: t()
  def nothing do
    %{
      by: nil,
      wishes: [],
      way: [],
      pose: nil,
      heading: nil,
      fault: nil,
      speed: nil,
      turn: nil,
      limits: [],
      power: nil,
      offline: [],
      estop: nil,
      layer: [],
      sonar: [],
      cone: :math.pi() / 12,
      seen: nil,
      camera: false,
      keeps: false,
      pictures: nil,
      looks: nil,
      sees: nil,
      notes: []
    }
  end

  defp told(status) do
    Map.merge(nothing(), %{
      by: status.by,
      wishes: for({by, weight} <- status.weights, do: [by, weight]),
      way: for({x, y} <- status.way, do: [x, y]),
      pose: with(%Pose{x: x, y: y} <- status.pose, do: [x, y]),
      heading: with(%Pose{heading: heading} <- status.pose, do: heading),
      fault: status.fault,
      speed: status.speed,
      limits: status.limits,
      power: status.power,
      offline: for({device, {:offline, _reason}} <- status.health, do: device),
      estop: status.estop,
      keeps: status.keeps,
      looks: Sight.words(status.head),
      sees: Sight.words(status.sees),
      notes: notes(status)
    })
  end

  # Only one that answers is asked, within half a second.
  defp asked(%{from: :robot, robot: robot}) do
    with {:ok, ranges} <- Swarm.sonar(robot),
         do: for({at, range} <- ranges, do: [at.x, at.y, at.heading, range]),
         else: (_not_known -> [])
  end

  defp asked(_row), do: []

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

  @doc """
  What a mission draws over the map (`t:Robot.Mission.layer/0`), as the page takes it.

      iex> Console.About.layer([{:polyline, "course", [{0.0, 1.0}]}, {:points, "points", [{2.0, 3.0, "1: 4 s ago"}]}])
      [%{kind: :polyline, name: "course", points: [[0.0, 1.0]]}, %{kind: :points, name: "points", points: [[2.0, 3.0, "1: 4 s ago"]]}]
      iex> Console.About.layer([{:cells, "mapped", 1.6, [{0.8, 0.8}]}])
      [%{kind: :cells, name: "mapped", size: 1.6, points: [[0.8, 0.8]]}]
  """
  @spec layer(Robot.Mission.layer()) :: [%{atom() => term()}]
  def layer(signs), do: Enum.map(signs, &sign/1)

  defp sign({kind, name, points}), do: %{kind: kind, name: name, points: lists(points)}

  defp sign({:cells, name, size, places}),
    do: %{kind: :cells, name: name, size: size, points: lists(places)}

  # To the centimetre.
  defp lists(tuples) do
    for tuple <- tuples do
      for value <- Tuple.to_list(tuple),
          do: if(is_float(value), do: Float.round(value, 2), else: value)
    end
  end

  @doc "What is known of a robot, as JSON."
  @spec json(atom(), map()) :: String.t()
  def json(robot, about), do: about |> Map.merge(%{t: "about", id: robot}) |> Json.encode!()

  @doc "A new picture of its camera as JPEG, or why there is none."
  @spec picture(atom()) :: {:ok, binary()} | {:error, line :: String.t()}
  def picture(robot), do: Swarm.Camera.snapshot(robot)

  # Where each sonar, or beam of a lidar, is on the body, where it looks, how far the nearest thing is, and how wide it looks to
  # each side: metres and radians.
  defp hears(profile, fresh) do
    fetch = fn key, _limit_ms ->
      with {value, age_ms} <- fresh[key], do: {:ok, value, age_ms}, else: (nil -> :error)
    end

    {body, ranges} = Snapshot.ranges(profile, fetch)

    sonar =
      for {%Pose{} = at, range} when range != nil <- Enum.zip(body.sonars, ranges || []),
          do: [at.x, at.y, at.heading, range]

    %{sonar: sonar, cone: body.sonar_cone / 2}
  end

  defp seen({%{blobs: blobs, marks: marks}, _age_ms}) do
    found =
      for(blob <- blobs, do: {blob, [blob.colour, blob.left, blob.top, blob.right, blob.bottom]}) ++
        for mark <- marks || [], do: {mark, [Mark.name(mark) | Tuple.to_list(Mark.box(mark))]}

    with [{first, _box} | _] <- found do
      %{width: first.width, height: first.height, boxes: for({_found, box} <- found, do: box)}
    else
      [] -> nil
    end
  end

  defp seen(nil), do: nil
end
