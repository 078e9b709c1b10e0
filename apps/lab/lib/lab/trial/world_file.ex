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
  alias Vision.Marks

  @degrees 180 / :math.pi()
  # The side of a mark in metres: a camera of 320 pixels across 60 degrees reads it at 4 m.
  @mark 0.3
  @most_id 65_535

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
      {marks, notes} = marks(world, names)

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

  # On models, and on the backs of robots of which no two have the same id.
  defp marks(world, names) do
    borne =
      for {%{mark: id, at: at}, name} when id != nil <- Enum.zip(world.robots, names),
          do: {id, name, at}

    often = borne |> Enum.map(&elem(&1, 0)) |> Enum.frequencies()
    {own, shared} = Enum.split_with(borne, fn {id, _name, _at} -> often[id] == 1 end)

    notes = told(shared, " of robots", "several have it")

    if world.marks == [] and own == [], do: {nil, notes}, else: hung(world, own, notes)
  end

  defp hung(world, own, notes) do
    with {:ok, %{family: family}} <- Marks.new(size: @mark), :ok <- Marks.available(family) do
      known? = fn {id, _where, _at} -> id <= @most_id and Marks.picture(family, id) != nil end

      {own, odd_own} = Enum.split_with(own, known?)
      {hung, odd} = Enum.split_with(world.marks, known?)
      at = for {id, pose, _at} <- hung, do: {id, pose(pose)}
      own = for {id, name, _at} <- own, do: {id, name}

      odd = told(odd ++ odd_own, "", "#{family} has no such mark")
      marks = [size: @mark, at: at, known: [], robots: own]
      {if(at != [] or own != [], do: marks), notes ++ odd}
    else
      {:error, line} -> {nil, notes ++ told(world.marks ++ own, "", line)}
    end
  end

  # Of several the first.
  defp told(marks, whose, why) do
    for {id, _where, {file, line, _column}} <- Enum.take(marks, 1),
        do: "#{file}:#{line}: fiducial_return #{id}#{whose} is left out: #{why}"
  end
end
