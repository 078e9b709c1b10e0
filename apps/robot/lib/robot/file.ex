defmodule Robot.File do
  @moduledoc """
  One file describes one robot: `config/robots/mag1.exs`. It is Elixir data, one list of keys, and
  is read, never run (`Robot.File.Reader`); `config/robots/template.exs` shows all keys;
  `Robot.File.Schema` is their table.

      {:ok, file} = Robot.File.load("config/robots/mag1.exs")
      {:ok, config} = Robot.File.config(file)

  All that is wrong with a file is said at once, each problem on a line that names file, line, key
  and what is allowed:

      config/robots/mag1.exs:7: limits.max_liner: is not known: allowed are max_linear, …; did you mean max_linear?

  A real robot arms by hand: `arm: :manual` is the default here, not in `Robot.Config`.
  """
  alias Hal.Options.Wording
  alias Hal.{Pose, Profile}
  alias Robot.Config
  alias Robot.File.{CrossChecks, Device, Reader, Schema, Terms}

  @enforce_keys [:id, :profile, :drive]
  defstruct @enforce_keys ++
              [
                ptz: nil,
                camera: nil,
                colours: nil,
                save_pictures: nil,
                limits: [],
                start: nil,
                arm: :manual,
                fence: nil,
                dry_run: false,
                estop_file: nil,
                console: nil,
                network: [],
                policies: []
              ]

  @type t :: %__MODULE__{
          id: atom(),
          profile: Profile.t(),
          drive: Config.module_options(),
          ptz: Config.module_options() | nil,
          camera: Config.module_options() | nil,
          colours: struct() | nil,
          save_pictures: keyword() | nil,
          limits: keyword(float()),
          start: Pose.t(),
          arm: :manual | :auto,
          fence: Robot.Safety.Reflex.Fence.t() | nil,
          dry_run: boolean(),
          estop_file: Path.t() | nil,
          console: keyword() | nil,
          network: keyword(),
          policies: keyword()
        }

  @largest 65_536
  @most_lines 40
  @config [
    :id,
    :profile,
    :drive,
    :ptz,
    :camera,
    :colours,
    :save_pictures,
    :limits,
    :start,
    :arm,
    :fence,
    :dry_run,
    :estop_file
  ]

  @doc """
  The robot of the file at `path`, or all that is wrong with it. A colour file is looked for beside
  it. `fleet:` are the names that there may be (default `Robot.File.Schema.fleet/0`). `tables:` are the types
  (`Hal.Options.Type`) of the keys whose words are those of an app above this one (`network:` and `policies:`: see
  `Swarm.MemberSpec.load/1`); such a key without a type may have any keys and values.

      iex> Robot.File.load("no/such.exs")
      {:error, ["no/such.exs: no such file or directory"]}
  """
  @spec load(Path.t(), keyword()) :: {:ok, t()} | {:error, [String.t(), ...]}
  def load(path, options \\ []) do
    # A pipe or a device may never end.
    with {:ok, %File.Stat{type: :regular, size: size}} when size <= @largest <- File.stat(path),
         {:ok, text} <- File.read(path) do
      folder = Path.dirname(path)

      read = fn file, options ->
        Vision.Colours.read(Path.expand(file, folder), options)
      end

      parse(text, Keyword.merge([file: path, colours: read], options))
    else
      {:ok, %File.Stat{type: :regular}} ->
        {:error, ["#{path}: no robot file is larger than #{div(@largest, 1024)} kB"]}

      {:ok, %File.Stat{type: type}} ->
        {:error, ["#{path}: is a #{type}, where a file is needed"]}

      {:error, reason} ->
        {:error, ["#{path}: #{:file.format_error(reason)}"]}
    end
  end

  @doc """
  The robot that a text describes. Options: `file:`, its name for errors; `fleet:` and `tables:` as in `load/2`;
  `colours:`, a function of path and options that reads a colour file (`t:Robot.File.Colours.reader/0`).

      iex> Robot.File.parse("[id: :mag1, profile: :magellan, drive: {Hal.RFlex.Driver, port: \\"/dev/ttyR0\\"}, arm: :manaul]", file: "mag1.exs")
      {:error, [
        "mag1.exs:1: arm: cannot be :manaul: :manual or :auto is allowed; did you mean :manual?"]}
  """
  @spec parse(String.t(), keyword()) :: {:ok, t()} | {:error, [String.t(), ...]}
  def parse(text, options \\ []) do
    file = Keyword.get(options, :file, "robot file")

    context = %{
      fleet: Keyword.get_lazy(options, :fleet, &Schema.fleet/0),
      tables: Keyword.get(options, :tables, []),
      colours: Keyword.get(options, :colours, fn _path, _options -> {:error, "no files here"} end)
    }

    with {:ok, {_line, value} = tree} <- Reader.read(text),
         :ok <- whole(value),
         {:ok, values} <- Terms.check(tree, Schema.table(context)),
         robot = robot(values),
         [] <- Terms.at(CrossChecks.problems(robot, file), tree) do
      {:ok, robot}
    else
      {:error, {line, text}} -> {:error, ["#{file}:#{line}: #{text}"]}
      {:error, problems} -> {:error, lines(file, problems)}
      problems -> {:error, lines(file, problems)}
    end
  end

  @doc """
  What the robot is started with, as far as it is its own: `Swarm.MemberSpec` adds mission and
  link. The drive is given the body, with the limits of this robot, if it asks for one (`profile:`).

  An error is a line of `Robot.Config.new/1`.
  """
  @spec config(t()) :: {:ok, Config.t()} | {:error, String.t()}
  def config(%__MODULE__{} = robot) do
    with {:ok, config} <- robot |> Map.take(@config) |> Map.to_list() |> Config.new(),
         {:ok, drive} <- Device.fit(robot.drive, config.profile),
         do: {:ok, %{config | drive: drive}}
  end

  defp whole({:keys, _keys}), do: :ok
  defp whole({:list, []}), do: :ok
  defp whole(_other), do: {:error, {1, "a robot file is one list, [key: value, …]"}}

  defp robot(values) do
    {body, values} = Keyword.pop(values, :body, [])
    profile = Schema.profile(values[:profile], body)

    struct!(
      __MODULE__,
      values |> Keyword.put(:profile, profile) |> Keyword.put_new(:start, Pose.new(0, 0))
    )
  end

  # Whoever has so many problems solves the first ones first.
  defp lines(file, problems) do
    more = length(problems) - @most_lines
    lines = problems |> Enum.take(@most_lines) |> Enum.map(&line(file, &1))
    if more > 0, do: lines ++ ["#{file}: and #{more} problems more"], else: lines
  end

  defp line(file, {line, path, text}), do: "#{file}:#{line}: #{Wording.path(path)}: #{text}"
end
