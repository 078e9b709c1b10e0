defmodule Console.Page.State do
  @moduledoc "Describes what the page is told of a fleet, as JSON. Pure; metres and radians, to millimetres and milliradians."
  alias Console.About
  alias Console.Cli.{Condition, Format}
  alias Console.Picture.Floorplan
  alias Console.Pace
  alias Hal.Json
  alias Hal.Options.Wording
  alias Sim.Scene

  # Of the stages the newest are told; the page keeps those before.
  @stages 40
  # Cells of the map that is sent, in metres.
  @cell 0.1

  @doc """
  What does not change: what the fleet offers, the missions that it may start, the kinds of messages that people may write to them
  (`Swarm.MissionRegistry.messages/0`) with what each field may be, and the map, its name, its size, and its walls as rectangles
  `[x, y, width, height]`, rows of equal cells. Where there is no map, its size is 0. `beside` is the scene of the run beside it.
  """
  @spec map(
          Scene.t(),
          [Console.Live.offer()],
          {missions :: [String.t()], [{mission :: String.t(), [{atom(), Hal.Options.table()}]}]},
          Scene.t() | nil
        ) :: String.t()
  def map(%Scene{map: map}, offers, {missions, messages}, beside \\ nil) do
    told = %{
      t: "map",
      offers: offers,
      missions: missions,
      hears: Enum.map(messages, &hears/1),
      cell: @cell,
      beside: beside && ground(beside.map)
    }

    map |> ground() |> Map.merge(told) |> Json.encode!()
  end

  defp hears({mission, kinds}) do
    kinds =
      for {kind, table} <- kinds do
        fields = for {name, type} <- table, do: {name, type |> List.wrap() |> hd()}

        %{
          kind: kind,
          fields: for({name, type} <- fields, do: %{name: name, allowed: Wording.expected(type)})
        }
      end

    %{mission: mission, kinds: kinds}
  end

  defp ground(nil), do: %{name: nil, width: 0, height: 0, walls: []}

  defp ground(map) do
    ground = Floorplan.of(map)
    {columns, rows} = {cells(ground.width), cells(ground.height)}

    walls =
      for row <- 0..(rows - 1)//1,
          {from, count} <- runs(ground, row, columns),
          do: [from, row, count]

    %{
      name: Path.basename(ground.name),
      width: round3(ground.width),
      height: round3(ground.height),
      walls: walls
    }
  end

  defp cells(metres), do: max(round(metres / @cell), 1)

  # The runs of wall in a row of cells, from the left: `{first, count}`.
  defp runs(ground, row, columns) do
    y = -ground.height / 2 + (row + 0.5) * @cell

    0..(columns - 1)//1
    |> Enum.chunk_by(&ground.wall?.(-ground.width / 2 + (&1 + 0.5) * @cell, y))
    |> Enum.filter(fn [first | _] ->
      ground.wall?.(-ground.width / 2 + (first + 0.5) * @cell, y)
    end)
    |> Enum.map(&{hd(&1), length(&1)})
  end

  @doc """
  The scene, with the pace of a run in lockstep (`nil`: real time), and what a person should know before all else. A
  robot of a real fleet may have no known pose, and `badges` are its conditions (`Console.Cli.Condition`). `now_ms` is the time of this node (`System.monotonic_time/1`), by which the
  page says when an order was given. Only robots of one `frame` are drawn together; `apart` says why one is not
  in that of most. `beside` is the scene of another run at the same time, if one is shown beside this one.
  """
  @spec scene(Scene.t(), Pace.t() | nil, String.t() | nil, now_ms :: integer(), Scene.t() | nil) ::
          String.t()
  def scene(%Scene{} = scene, pace, notice, now_ms, beside \\ nil) do
    scene
    |> run()
    |> Map.merge(%{t: "scene", now: now_ms, notice: notice, beside: beside && run(beside)})
    |> Map.merge(pace(pace))
    |> Json.encode!()
  end

  defp pace(pace) do
    %{
      pace: pace && Pace.words(pace),
      speed: pace && speed(pace.speed),
      paused: pace != nil and pace.left == 0
    }
  end

  # As the page's list of speeds has it.
  defp speed(:max), do: "max"
  defp speed(speed), do: String.replace(Format.decimals(speed, 2), ~r/\.?0+$/, "")

  defp run(scene) do
    %{
      at_s: scene.at_ms / 1000,
      mission: scene.mission,
      layer: About.layer(scene.layer),
      leader: scene.leader,
      epoch: scene.epoch,
      formation: scene.formation && Tuple.to_list(scene.formation),
      error: scene.error && Enum.map(Tuple.to_list(scene.error), &round3/1),
      formed: scene.formed?,
      estop: Format.estop(scene),
      landmark: point(scene.landmark),
      objects: Enum.map(scene.objects, &object/1),
      robots: Enum.map(scene.robots, &robot/1),
      told: Scene.told(scene.stages),
      stages: scene.stages |> Enum.take(-@stages) |> Enum.map(&stage/1)
    }
  end

  @doc "What a recording tells of its run (`t:Console.Live.history/0`)."
  @spec history(Console.Live.history()) :: String.t()
  def history(history) do
    entries = for entry <- history.entries, do: rounded(entry)
    Json.encode!(%{history | entries: entries} |> Map.put(:t, "history"))
  end

  @doc """
  What robots have said to each other of late (`c:Console.Live.messages/1`), or the nodes (`c:Console.Live.nodes/1`), or why that is not known.

      iex> Console.Page.State.watched(:nodes, {:error, "not here"})
      ~S({"entries":[],"t":"nodes","why":"not here"})
  """
  @spec watched(:messages | :nodes, {:ok, [map()]} | {:error, String.t()}) :: String.t()
  def watched(what, {:ok, entries}), do: Json.encode!(%{t: what, why: nil, entries: entries})
  def watched(what, {:error, line}), do: Json.encode!(%{t: what, why: line, entries: []})

  defp rounded(entry) do
    stages = Enum.map(entry.stages, &stage/1)
    error = with [_mean, _max] = error <- entry[:error], do: Enum.map(error, &round3/1)
    Map.merge(entry, %{stages: stages, error: error})
  end

  defp robot(robot) do
    conditions = Condition.of(robot)

    %{
      id: robot.id,
      x: robot.pose && round3(robot.pose.x),
      y: robot.pose && round3(robot.pose.y),
      a: robot.pose && round3(robot.pose.heading),
      r: robot.radius,
      box: Enum.map(robot[:corners] || [], &point/1),
      alive: robot.alive,
      state: shown(robot.state),
      slot: point(robot.slot),
      off: robot.slot && round3(Scene.slot_error(robot)),
      unsure: round3(robot.uncertainty),
      leader: robot.leader?,
      follows: robot[:follows],
      frame: robot[:frame] || 0,
      apart: robot[:apart],
      bars: Condition.bars(conditions),
      badges:
        for(c <- conditions, do: %{kind: c.kind, word: c.word, why: c.why, instead: c.instead?})
    }
  end

  defp shown(:estop), do: "E-STOP"
  defp shown(state), do: state

  # A mesh has the time of day, and says itself what it tells of.
  defp stage(stage) do
    %{
      at_s: stage.at_s,
      time: stage[:clock] || Format.decimals(stage.at_s, 1) <> " s",
      mark: stage.stage,
      what: words(stage[:about] || stage.stage),
      text: stage[:line] || Format.meaning(stage),
      robot: stage[:robot],
      ends: stage[:ends] || ended(stage.stage)
    }
  end

  # What each stage ends, as the page's list says it.
  defp ended(:estop_over), do: "emergency stop"
  defp ended(:world_back), do: "world lost"
  defp ended(:radio_whole), do: "radio cut"
  defp ended(_stage), do: nil

  defp words(:estop_holds), do: "emergency stop"
  defp words(name), do: name |> to_string() |> String.replace("_", " ")

  defp object(%{id: id, kind: kind, pose: pose, radius: radius, corners: corners}),
    do: %{
      id: id,
      kind: kind,
      at: point(Hal.Pose.point(pose)),
      r: round3(radius),
      box: Enum.map(corners, &point/1)
    }

  defp point(nil), do: nil
  defp point({x, y}), do: [round3(x), round3(y)]

  defp round3(nil), do: nil
  defp round3(number), do: Float.round(number * 1.0, 3)

  @doc """
  An answer to what was typed or clicked.

      iex> Console.Page.State.answer("kill mag1", {:ok, "done"})
      ~S({"line":"kill mag1","ok":true,"t":"answer","text":"kill mag1: done"})
  """
  @spec answer(String.t(), {:ok, String.t() | [String.t()]} | {:error, String.t()}) :: String.t()
  def answer(line, answer) do
    {ok?, text} = answered(line, answer)
    Json.encode!(%{t: "answer", line: line, ok: ok?, text: text})
  end

  defp answered(_line, {:ok, lines}) when is_list(lines), do: {true, Enum.join(lines, "\n")}
  defp answered(line, {:ok, text}), do: {true, "#{line}: #{text}"}
  defp answered(_line, {:error, text}), do: {false, text}
end
