defmodule Robot.File do
  @moduledoc """
  Reads robot files. One file describes one robot, for example `config/robots/mag1.exs`. It is
  Elixir data, one list of keys, and is parsed, never executed (`Robot.File.Reader`).
  `config/robots/template.exs` shows all keys; `Robot.File.Schema` is their table.

      {:ok, file} = Robot.File.load("config/robots/mag1.exs")
      {:ok, config} = Robot.File.config(file)

  A file that does not parse gives the first problem. Otherwise up to 40 problems are reported
  together, each as one line of text with the file, the line, the key and what is wrong. Checks
  that involve several keys come last, once each key by itself is right.

      config/robots/mag1.exs:7: limits.max_liner: is not known: allowed are max_linear, …; did you mean max_linear?

  A person arms a real robot by hand: `arm: :manual` is the default here, but not in
  `Robot.Config`.
  """
  alias Hal.{Pose, Profile, RobotName}
  alias Robot.File.{Bodies, Body, Device, Reader, Schema, Terms}
  alias Nav.MapFile
  alias Hal.Options.Suggest

  @enforce_keys [:id, :profile, :drive]
  defstruct @enforce_keys ++
              [
                ptz: nil,
                camera: nil,
                scan: nil,
                colours: nil,
                marks: nil,
                save_pictures: nil,
                limits: [],
                start: nil,
                map: nil,
                arm: :manual,
                fence: nil,
                dry_run: false,
                replace: false,
                say: nil,
                presence: nil,
                estop_file: nil,
                console: nil,
                record: nil,
                incidents: nil,
                network: [],
                policies: []
              ]

  @type t :: %__MODULE__{
          id: atom(),
          profile: Profile.t(),
          drive: Robot.Config.module_options(),
          ptz: Robot.Config.module_options() | nil,
          camera: Robot.Config.module_options() | nil,
          scan: Robot.Config.module_options() | nil,
          colours: struct() | nil,
          marks: keyword() | nil,
          save_pictures: keyword() | nil,
          limits: keyword(float()),
          start: Pose.t(),
          map: Nav.MapFile.t() | nil,
          arm: :manual | :auto,
          fence: Robot.Fence.t() | nil,
          dry_run: boolean(),
          replace: boolean(),
          say: keyword() | nil,
          presence: float() | nil,
          estop_file: Path.t() | nil,
          console: keyword() | nil,
          record: keyword() | nil,
          incidents: keyword() | nil,
          network: keyword(),
          policies: keyword()
        }

  @config [
    :id,
    :profile,
    :drive,
    :ptz,
    :camera,
    :scan,
    :colours,
    :marks,
    :save_pictures,
    :limits,
    :start,
    :arm,
    :fence,
    :dry_run,
    :replace,
    :say,
    :presence,
    :estop_file
  ]

  @doc """
  The robot of the file at `path`, or the problems with it. The paths of a colour file and of a map are relative
  to the robot file's folder; the files of bodies are where `Robot.File.Bodies.folders/1` says. `tables:` are the types (`Hal.Options.Type`) of the keys that an
  app above this one defines (`network:` and `policies:`, see `Swarm.MemberSpec.load/1`); such a
  key without a type may have any keys and values.

      iex> Robot.File.load("no/such.exs")
      {:error, ["no/such.exs: no such file or directory"]}
  """
  @spec load(Path.t(), keyword()) :: {:ok, t()} | {:error, [String.t(), ...]}
  def load(path, options \\ []) do
    with {:ok, text} <- Reader.text(path) do
      folder = Path.dirname(path)

      read = fn file, options ->
        Vision.Colours.read(Path.expand(file, folder), options)
      end

      map = &MapFile.open(Path.expand(&1, folder))
      bodies = &Bodies.fetch(&1, Bodies.folders(path))
      given = [file: path, colours: read, map: map, bodies: bodies]
      parse(text, Keyword.merge(given, options))
    end
  end

  @doc """
  The robot that a text describes. Options: `file:`, its name in error messages; `tables:` as in `load/2`; `bodies:`, a
  function that finds a body by its name (`t:Robot.File.Schema.bodies/0`; default those that come along); `colours:`, a function of path and options that reads a colour file
  (`t:Robot.File.Colours.reader/0`); `map:`, a function of a path that reads a map (`t:Robot.File.Map.reader/0`).

      iex> Robot.File.parse("[id: :mag1, profile: :magellan, drive: {Hal.RFlex.Driver, port: \\"/dev/ttyR0\\"}, arm: :manaul]", file: "mag1.exs")
      {:error, [
        "mag1.exs:1: arm: expected :manual or :auto, got :manaul; did you mean :manual?"]}
  """
  @spec parse(String.t(), keyword()) :: {:ok, t()} | {:error, [String.t(), ...]}
  def parse(text, options \\ []) do
    file = Keyword.get(options, :file, "robot file")

    context = %{
      bodies: Keyword.get(options, :bodies, &Bodies.fetch(&1, [])),
      bodiless?: true,
      tables: Keyword.get(options, :tables, []),
      colours:
        Keyword.get(options, :colours, fn _path, _options -> {:error, "no files here"} end),
      map: Keyword.get(options, :map, fn _path -> {:error, "no files here"} end)
    }

    with {:ok, {_line, value} = tree} <- Reader.read(text),
         :ok <- whole(value),
         context = %{context | bodiless?: not key?(value, "body")},
         {:ok, values} <- Terms.check(tree, Schema.table(context)),
         {:ok, robot} <- robot(values, tree),
         [] <- Terms.at(problems(robot, file), tree) do
      {:ok, robot}
    else
      {:error, {line, text}} -> {:error, ["#{file}:#{line}: #{text}"]}
      {:error, problems} -> {:error, Reader.lines(problems, file)}
      problems -> {:error, Reader.lines(problems, file)}
    end
  end

  @doc """
  The config of the robot, without the parts that concern the fleet: `Swarm.MemberSpec` adds
  mission and link. A drive with an option `profile:` gets the body, with the limits of this
  robot.

  An error is the line of `Robot.Config.new/1`, or of a drive that does not fit the body.
  """
  @spec config(t()) :: {:ok, Robot.Config.t()} | {:error, String.t()}
  def config(%__MODULE__{} = robot) do
    options = robot |> Map.take(@config) |> Map.put(:plan, robot.map && robot.map.grid)
    options = %{options | marks: known(robot)}

    with {:ok, config} <- options |> Map.to_list() |> Robot.Config.new(),
         {:ok, drive} <- Device.fit(robot.drive, config.profile),
         do: {:ok, %{config | drive: drive}}
  end

  # What the robot's own file says of a mark counts before what the map says.
  defp known(%{marks: [_ | _] = marks, map: %MapFile{marks: on_map}}) do
    own = Keyword.get(marks, :known, [])
    others = Enum.reject(on_map, fn {id, _place} -> List.keymember?(own, id, 0) end)
    Keyword.put(marks, :known, own ++ others)
  end

  defp known(%{marks: marks}), do: marks

  defp whole({:keys, _keys}), do: :ok
  defp whole({:list, []}), do: :ok
  defp whole(_other), do: {:error, {1, "a robot file is one list, [key: value, …]"}}

  defp key?({:keys, keys}, name), do: List.keymember?(keys, name, 0)
  defp key?({:list, []}, _name), do: false

  # Without a `profile:` the body must be whole.
  defp robot(values, tree) do
    {body, values} = Keyword.pop(values, :body, [])

    case Body.build(values[:id], body, values[:profile]) do
      {:ok, profile} ->
        values =
          values |> Keyword.put(:profile, profile) |> Keyword.put_new(:start, Pose.new(0, 0))

        {:ok, struct!(__MODULE__, values)}

      {:error, problems} ->
        {:error, Terms.at(for({path, text} <- problems, do: {["body" | path], text}), tree)}
    end
  end

  # Checks of a robot file that involve several keys. Pure.

  # All problems, each as the path of its key and a text; `file` is the robot file's path.
  defp problems(robot, file) do
    Enum.reject(
      [
        named(robot, file),
        seen(robot),
        scanned(robot),
        marked(robot),
        kept(robot),
        placed(robot),
        shared(robot),
        colour(robot) | limits(robot) ++ driven(robot)
      ],
      &(&1 == nil)
    )
  end

  # If a file is copied for another robot and its id is not changed, two robots have the same
  # name. A file with a name of no such form, such as a template, may be named otherwise.
  defp named(robot, file) do
    name = Path.basename(file, ".exs")
    usual? = Enum.any?(RobotName.usual(), &(Atom.to_string(&1) == name))
    numbered? = RobotName.kind(name) == RobotName.kind(robot.id) and RobotName.kind(name) != name

    if (usual? or numbered?) and name != Atom.to_string(robot.id),
      do: {["id"], "is #{inspect(robot.id)}, but the file is named #{name}.exs"}
  end

  defp seen(%{camera: camera, colours: nil}) when camera != nil,
    do: {["colours"], "is missing: a robot with a camera must have colours"}

  defp seen(%{camera: camera, profile: %{camera: nil} = body}) when camera != nil,
    do:
      {["camera"], "is for a body with a camera, and #{body.name} has none: body: [camera: […]]"}

  defp seen(_robot), do: nil

  # Where it is on the body, says the body.
  defp scanned(%{scan: scan, profile: %{scan: nil} = body}) when scan != nil,
    do: {["scan"], "is for a body with a lidar, and #{body.name} has none: body: [scan: […]]"}

  defp scanned(_robot), do: nil

  defp marked(%{marks: marks, camera: nil}) when marks != nil,
    do: {["marks"], "is for a robot with a camera, and it has none"}

  defp marked(_robot), do: nil

  defp kept(%{save_pictures: nil}), do: nil

  defp kept(%{camera: nil}),
    do: {["save_pictures"], "is for a robot with a camera, and it has none"}

  defp kept(_robot), do: nil

  defp placed(%{map: map, start: start}) do
    with line when line != nil <- Robot.File.Map.start(map, start), do: {["start"], line}
  end

  # A serial line has one device at its other end. A port may be a name in /dev.
  defp shared(%{drive: {_drive, drive}} = robot) do
    Enum.find_value([:ptz, :scan], fn key ->
      with {_driver, options} <- Map.fetch!(robot, key),
           [base, port] when is_binary(base) and is_binary(port) <- [drive[:port], options[:port]],
           true <- Path.expand(base, "/dev") == Path.expand(port, "/dev"),
           do:
             {["#{key}", "port"], "is #{inspect(port)}, the drive's: each has a line of its own"},
           else: (_another -> nil)
    end)
  end

  defp colour(%{colours: nil}), do: nil

  defp colour(%{colours: colours, policies: policies}) do
    names = Enum.map(colours.classes, & &1.name)
    colour = policies[:colour]

    if colour != nil and colour not in names,
      do:
        {["policies", "colour"],
         "expected one of the colours #{Enum.join(names, ", ")}, got #{inspect(colour)}" <>
           Suggest.hint(colour, names)}
  end

  # Some drives check their options against the body, such as how many sensors they read.
  defp driven(%{drive: drive, profile: profile}) do
    case Device.fit(drive, profile) do
      {:ok, _drive} -> []
      {:error, line} -> [{["drive"], line}]
    end
  end

  defp limits(%{limits: limits, profile: profile}) do
    for {name, value} <- limits, most = Map.fetch!(profile, name), value > most do
      {["limits", Atom.to_string(name)],
       "expected at most #{most}, which a #{profile.name} can do, got #{value}"}
    end
  end
end
