defmodule Mix.Tasks.Robot.Import do
  @shortdoc "Makes a robot file from a Player configuration"
  @moduledoc """
  Converts a configuration of the Player device server, 1.x or later, into a robot file.

      mix robot.import FILE [-o OUT] [options]

  What Player calls `rflex`, `sonyevid30`, `camerav4l` and `cmvision` is carried over, in metres
  and radians. What was assumed, and what could not be carried over, is listed with its line and
  the reason. A file that leaves open where sensors are, or on which board, is refused with the
  line. Without OUT the robot file goes to standard output, and everything else to standard error.
  A robot file that cannot start a robot is written too, for you to correct; then the errors are
  listed, and the exit status is 1.

  `--help` lists the options.
  """
  use Mix.Task
  alias Hal.Options.Suggest
  alias Hal.RobotName
  alias Robot.File.{Bodies, Warnings}

  @options [
    {"out", "OUT", &Hal.Cli.Parse.text/1,
     "where to write it, such as config/robots/mag2.exs (or -o OUT);\nnever overwrites a file"},
    {"force", nil, nil, "overwrites a file that exists"},
    {"name", "NAME", &Hal.Cli.Parse.text/1,
     "the robot's name; by default that of OUT, else mag1 or min1"},
    {"profile", "KIND", &__MODULE__.profile/1,
     "its body, such as magellan, atrv_mini, pioneer3; by default guessed,\nmagellan or atrv_mini"},
    {"player", "N", &__MODULE__.version/1,
     "1 for Player 1.x (millimetres, degrees), 2 for later ones (metres);\nby default found out from the names of the options"}
  ]
  @largest 1_048_576

  @impl Mix.Task
  def run(words) do
    words = Enum.map(words, &if(&1 == "-o", do: "--out", else: &1))
    Hal.Cli.Command.run("robot.import", words, {@moduledoc, @options}, &carry_over/2)
  end

  defp carry_over(given, files) do
    options = Map.new(given)

    with {:ok, file} <- one(files),
         {:ok, id} <- name(options),
         :ok <- free(options["out"], options["force"]),
         {:ok, text} <- read(file),
         colours = colours(file, options["out"]),
         wanted = [
           file: file,
           id: id,
           profile: options["profile"],
           version: options["player"],
           colours: colours
         ],
         {:ok, result} <- Player.import(text, wanted),
         :ok <- write(result.text, options["out"]) do
      tell(result, file, options["out"])
      judge(result.text, file, options["out"])
    end
  end

  # It is written for a person to correct, but nobody should think that it is right.
  defp judge(text, file, out) do
    with {:ok, robot} <- made(text, file, out),
         {:ok, _config} <- Robot.File.config(robot) do
      # It does not matter yet whether its devices exist here.
      odd = Warnings.lines(robot, fn _device -> true end)
      if odd != [], do: say("Odd; check whether this is meant:")
      Enum.each(odd, &say("  #{&1}"))
    else
      {:error, lines} ->
        say("To be corrected; no robot starts with this:")
        for line <- List.wrap(lines), do: say("  #{line}")
        exit({:shutdown, 1})
    end
  end

  defp made(_text, _file, out) when out != nil, do: Robot.File.load(out)

  defp made(text, file, nil) do
    folder = Path.dirname(file)
    read = fn name, options -> Vision.Colours.read(Path.expand(name, folder), options) end
    Robot.File.parse(text, colours: read)
  end

  defp one([file]), do: {:ok, file}
  defp one([]), do: {:error, "FILE is missing: mix robot.import FILE"}
  defp one(files), do: {:error, "one file at a time, not #{length(files)}"}

  # OUT names the robot unless `--name` does, if OUT is a robot's name at all.
  defp name(options) do
    named = if out = options["out"], do: find(Path.basename(out, ".exs"))
    asked = if name = options["name"], do: find(name)

    cond do
      options["name"] == nil ->
        {:ok, named}

      asked == nil ->
        {:error, "--name #{options["name"]}: expected #{RobotName.allowed()}"}

      named not in [nil, asked] ->
        {:error, "--name #{asked} does not match a file named #{named}.exs"}

      true ->
        {:ok, asked}
    end
  end

  # Typed by a person, so it may become an atom.
  defp find(name), do: with({:ok, id} <- RobotName.read(name), do: id, else: (:error -> nil))

  @doc false
  @spec profile(String.t()) :: {:ok, atom()} | {:error, Hal.Cli.Arguments.allowed()}
  def profile(text) do
    case Bodies.fetch(text) do
      {:ok, body} ->
        {:ok, body.name}

      {:error, _lines} ->
        known = Bodies.names()
        {:error, {Hal.Cli.Parse.either(known), Suggest.hint(text, known)}}
    end
  end

  @doc false
  @spec version(String.t()) :: {:ok, 1 | 2} | {:error, String.t()}
  def version("1"), do: {:ok, 1}
  def version("2"), do: {:ok, 2}
  def version(_other), do: {:error, "1 for 1.x or 2 for later ones"}

  defp free(nil, _force), do: :ok
  defp free(_out, true), do: :ok

  defp free(out, _force),
    do:
      if(File.exists?(out),
        do: {:error, "#{out} exists already; --force overwrites it"},
        else: :ok
      )

  defp read(file) do
    with {:ok, %File.Stat{type: :regular, size: size}} when size <= @largest <- File.stat(file),
         {:ok, text} <- File.read(file) do
      {:ok, text}
    else
      {:ok, %File.Stat{type: :regular}} -> {:error, "#{file}: larger than 1 MB"}
      {:ok, %File.Stat{type: type}} -> {:error, "#{file}: is a #{type}, not a file"}
      {:error, reason} -> {:error, "#{file}: #{:file.format_error(reason)}"}
    end
  end

  # The path of the colour file in a robot file is relative to the robot file.
  defp colours(file, out) do
    folder = file |> Path.expand() |> Path.dirname()
    target = if out, do: out |> Path.expand() |> Path.dirname(), else: folder

    fn name ->
      path = Path.expand(name, folder)
      {if(folder == target, do: name, else: path), Vision.Colours.read(path)}
    end
  end

  defp write(text, nil), do: IO.write(text)

  defp write(text, out) do
    with {:error, reason} <- File.write(out, text),
         do: {:error, "#{out} cannot be written: #{:file.format_error(reason)}"}
  end

  defp tell(result, file, out) do
    list("Assumed; check whether this is right:", result.assumed, file)
    list("Not carried over:", result.left, file)
    where = if out, do: "#{out} written", else: "#{result.id}"
    next = if out, do: "; mix robot.check #{out} shows what it says", else: ""

    say(
      "#{where}: #{length(result.assumed)} assumed, #{length(result.left)} not carried over#{next}"
    )
  end

  defp list(_title, [], _file), do: :ok

  defp list(title, remarks, file) do
    say(title)
    for {line, what, why} <- remarks, do: say("  #{file}:#{line}: #{what}: #{why}")
  end

  # Standard output may hold the robot file.
  defp say(line), do: IO.puts(:stderr, line)
end
