defmodule Robot.File.Bodies do
  @moduledoc """
  Finds bodies by their names: those that come along, and files of this machine's own, `NAME.exs` in a folder of bodies
  (`config/bodies`). All of them are data (`Robot.File.Body`).

  | body | also called | |
  |---|---|---|
  | `magellan`, `atrv_mini` | `mag`, `min` | `Hal.Profile`, because the driver of their base has them, too |
  | `turtlebot3_burger`, `turtlebot3_waffle` | `burger`, `waffle` | files in `apps/robot/bodies`, which the build takes in; they name their sources |
  | `create2`, `kobuki`, `pioneer3` | | the same |
  """
  alias Hal.{Profile, RobotName}
  alias Hal.Options.Suggest
  alias Robot.File.{Body, Reader}

  @folder "config/bodies"
  @sources Path.wildcard(Path.expand("../../../bodies/*.exs", __DIR__))

  for source <- @sources, do: @external_resource(source)

  @files (for source <- @sources do
            name = source |> Path.basename(".exs") |> String.to_atom()
            {:ok, profile} = source |> File.read!() |> Body.parse(name, source)
            profile
          end)
  @short %{
    "mag" => "magellan",
    "min" => "atrv_mini",
    "burger" => "turtlebot3_burger",
    "waffle" => "turtlebot3_waffle"
  }

  @typedoc "Where files of bodies are looked for, in this order."
  @type folders :: [Path.t()]

  @doc """
  The bodies that come along.

      iex> Enum.map(Robot.File.Bodies.all(), & &1.name)
      [:magellan, :atrv_mini, :create2, :kobuki, :pioneer3, :turtlebot3_burger, :turtlebot3_waffle]
  """
  @spec all() :: [Profile.t(), ...]
  def all, do: [Profile.magellan(), Profile.atrv_mini() | @files]

  @doc "The short names, and the names of all bodies: those that come along first, then those with a file of their own."
  @spec names(folders()) :: [String.t(), ...]
  def names(folders \\ [@folder]) do
    own = for folder <- folders, path <- Path.wildcard(folder <> "/*.exs"), do: name(path)

    known = Enum.map(all(), &Atom.to_string(&1.name))
    Enum.sort(Map.keys(@short)) ++ known ++ (Enum.uniq(own) -- known)
  end

  @doc """
  The short name of a body, or its own: that which fleets of it have before their numbers.

      iex> Enum.map([:magellan, :create2], &Robot.File.Bodies.short/1)
      ["mag", "create2"]
  """
  @spec short(atom()) :: String.t()
  def short(name) do
    Enum.find_value(@short, "#{name}", fn {short, long} -> if long == "#{name}", do: short end)
  end

  @doc """
  The folders of bodies that belong to a robot's file: `bodies` in its own, and beside that.

      iex> Robot.File.Bodies.folders("config/robots/mag1.exs")
      ["config/robots/bodies", "config/bodies"]
  """
  @spec folders(robot_file :: Path.t()) :: folders()
  def folders(file) do
    folder = Path.dirname(file)
    [Path.join(folder, "bodies"), Path.join(Path.dirname(folder), "bodies")]
  end

  @doc """
  The body of a name, long or short; the errors are lines.

      iex> {:ok, body} = Robot.File.Bodies.fetch("burger")
      iex> {body.name, body.max_linear}
      {:turtlebot3_burger, 0.22}
      iex> Robot.File.Bodies.fetch("buger", [])
      {:error, ["no body is named buger: there are burger, mag, min, waffle, magellan, atrv_mini, create2, kobuki, " <>
        "pioneer3, turtlebot3_burger, turtlebot3_waffle; did you mean burger?"]}
  """
  @spec fetch(atom() | String.t(), folders()) :: {:ok, Profile.t()} | {:error, [String.t(), ...]}
  def fetch(name, folders \\ [@folder]) do
    text = to_string(name)
    long = Map.get(@short, text, text)

    case {Enum.find(all(), &(Atom.to_string(&1.name) == long)), file(long, folders)} do
      {%Profile{} = body, nil} ->
        {:ok, body}

      {%Profile{}, path} ->
        {:error, ["#{path}: #{long} is a body that comes along; another name is needed"]}

      {nil, nil} ->
        known = names(folders)

        {:error,
         ["no body is named #{text}: there are #{list(known)}#{Suggest.hint(text, known)}"]}

      {nil, path} ->
        read(path)
    end
  end

  # A name of another form might be a path that leads elsewhere.
  defp file(name, folders) do
    if RobotName.valid?(name),
      do: folders |> Enum.map(&Path.join(&1, name <> ".exs")) |> Enum.find(&File.regular?/1)
  end

  defp read(path) do
    with {:ok, text} <- Reader.text(path, "body"), {:ok, name} <- RobotName.read(name(path)) do
      Body.parse(text, name, path)
    end
  end

  defp name(path), do: Path.basename(path, ".exs")
  defp list(names), do: Enum.join(names, ", ")
end
