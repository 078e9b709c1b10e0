defmodule Lab.Trial.WorldFile do
  @moduledoc """
  Turns a world file of Stage (`Sim.Stage`) into the options of a run: its map, its robots with their bodies and start poses, the
  landmark, balls, boxes and marks. Pure but for reading the files.

  Names of robots become atoms here, as those of a robot's file do: at most a thousand a file.
  """
  alias Hal.Options.Type
  alias Hal.RobotName
  alias Robot.File.Body
  alias Sim.Stage

  @degrees 180 / :math.pi()
  # The side of a mark in metres: a camera of 320 pixels across 60 degrees reads it at 4 m.
  @mark 0.3

  @enforce_keys [:options, :notes]
  defstruct @enforce_keys

  @typedoc "`options` are those of `Lab.Trial.Setup.new/1`; `notes` are lines that say what of the file is left out."
  @type t :: %__MODULE__{options: keyword(), notes: [String.t()]}

  @doc "The options that a world's file says itself, whatever it has."
  @spec keys() :: [atom(), ...]
  def keys, do: [:robots, :bodies, :map, :start]

  @doc "The run in the world of a file; the error is one line."
  @spec open(Path.t()) :: {:ok, t()} | {:error, line :: String.t()}
  def open(file) do
    with {:ok, world} <- Stage.open(file),
         names = names(world.robots),
         {:ok, bodies} <- bodies(Enum.zip(names, world.robots), []) do
      {marks, notes} = marks(world)

      options = [
        robots: names,
        bodies: bodies,
        map: file,
        start: for(robot <- world.robots, do: pose(robot.pose)),
        landmark: world.landmark || :none,
        balls: world.balls,
        boxes:
          for(
            {pose, length, width} <- world.boxes,
            do: Tuple.to_list(pose(pose)) ++ [length, width]
          )
          |> Enum.map(&List.to_tuple/1),
        marks: marks
      ]

      {:ok, %__MODULE__{options: options, notes: world.notes ++ notes}}
    end
  end

  defp pose(pose), do: {pose.x, pose.y, pose.heading * @degrees}

  # Their own names in small letters where these are names here and no other robot has them; else that of their kind, numbered.
  defp names(robots) do
    own = for robot <- robots, do: robot.name && letters(robot.name)

    once =
      for {name, 1} <- Enum.frequencies(own),
          name != nil,
          RobotName.valid?(name),
          into: MapSet.new(),
          do: name

    {names, _used} =
      Enum.map_reduce(Enum.zip(robots, own), once, fn {robot, name}, used ->
        if name in once do
          {name, used}
        else
          name = robot.kind |> kind() |> numbered(used)
          {name, MapSet.put(used, name)}
        end
      end)

    for name <- names, {:ok, id} = RobotName.read(name), do: id
  end

  defp letters(text), do: text |> String.downcase() |> String.replace(~r/[^a-z0-9_]/, "_")

  defp kind(text) do
    kind = text |> letters() |> String.slice(0, 24)
    if RobotName.valid?(kind), do: kind, else: "robot"
  end

  defp numbered(kind, used) do
    gap = if kind =~ ~r/\d\z/, do: "_", else: ""

    1
    |> Stream.iterate(&(&1 + 1))
    |> Stream.map(&"#{kind}#{gap}#{&1}")
    |> Enum.find(&(&1 not in used))
  end

  defp bodies([], done), do: {:ok, Enum.reverse(done)}

  defp bodies([{id, robot} | rest], done) do
    with {:ok, values} <- Type.read(Body.type(), robot.body),
         {:ok, body} <- Body.build(:stage, values, nil) do
      bodies(rest, [{id, %{body | about: "a #{robot.kind}"}} | done])
    else
      {:error, [{path, text} | _more]} ->
        {file, line, column} = robot.at
        {:error, "#{file}:#{line}:#{column}: #{id}: #{Enum.join(path, ".")}: #{text}"}
    end
  end

  # What robots can tell apart: each id hangs once.
  defp marks(%{marks: []}), do: {nil, []}

  defp marks(world) do
    with {:ok, %{family: family}} <- Vision.Marks.new(size: @mark),
         :ok <- Vision.Marks.available(family) do
      {known, odd} =
        Enum.split_with(world.marks, fn {id, _} ->
          id <= 65_535 and Vision.Marks.picture(family, id) != nil
        end)

      at = for {id, pose} <- known, do: {id, pose(pose)}

      notes =
        for {id, _pose} <- Enum.take(odd, 1),
            do: "#{world.file}: fiducial_return #{id} is left out: #{family} has no such mark"

      {if(at != [], do: [size: @mark, at: at, known: []]), notes}
    else
      {:error, line} -> {nil, ["#{world.file}: fiducial_return is left out: #{line}"]}
    end
  end
end
