defmodule Console.Emulate do
  @moduledoc "Emulates the devices of a robot on serial lines until a person ends it, and prints where its body is and what its wheels do."
  alias Console.Cli.Format
  alias Console.{Fleet, Options}
  alias Hal.Cli.{Arguments, Parse}
  alias Lab.Emulation

  @look_ms 200
  # By the controllers of the bases that come along.
  @boards %{"rflex" => "mag", "turtlebot3" => "burger", "create" => "create2"}

  @doc "Runs the command; returns the exit status, or what is wrong, line by line. Names of files are relative to `folder`."
  @spec run([String.t()], Path.t()) :: 0 | {:error, [String.t()] | String.t()}
  def run(arguments, folder) do
    with {:ok, pairs, words} <- Arguments.parse_words(arguments, table(folder)) do
      if List.keymember?(pairs, "help", 0), do: help(folder), else: begin(words, Map.new(pairs))
    end
  end

  defp help(folder) do
    IO.puts("""
    Emulates the controller of a base, and its lidar and its camera's head where it has them, on pseudo-terminals,
    with the body in a small simulated world behind them: a robot to try drivers, robot files and orders on.

      bin/emulate BODY --link FILE [options]

    BODY is that of a robot, such as mag, min, burger, create2 or kobuki, or one of config/bodies; or a controller: rflex,
    turtlebot3 or create.

    #{Arguments.help(table(folder))}

    Examples
      bin/emulate rflex --link base              a Magellan Pro: its base on ./base, its camera's head on ./base.camera
      bin/emulate burger --link tb3 --map rooms:3   a TurtleBot3 with its lidar on ./tb3.scan, in an office

    It goes on until Ctrl-C, and says what the wheels do whenever that changes.
    """)

    0
  end

  defp table(folder) do
    [
      {"link", "FILE", &link(&1, folder),
       "the base's line: a link to a pseudo-terminal (those of lidar and camera: FILE.scan, FILE.camera)"},
      {"map", "NAME|FILE", &Parse.text/1, "the world around it, as for bin/demo (hall)"},
      {"seed", "N", &Parse.whole(&1, 0..1_000_000_000), "of its place and of noise (1)"}
    ]
  end

  defp link("", _folder), do: {:error, "the name of a file"}
  defp link(text, folder), do: {:ok, Path.expand(text, folder)}

  defp begin([], _options), do: {:error, "which body? such as bin/emulate rflex --link base"}
  defp begin([_one, other | _], _options), do: {:error, "one body at a time, not #{other} too"}

  defp begin([_body], options) when not is_map_key(options, "link"),
    do: {:error, "--link is missing: the file by which the base's line is found"}

  defp begin([word], %{"link" => link} = options) do
    asked = "#{Map.get(@boards, word, word)}:1"

    more = for name <- ["map", "seed"], value = options[name], do: "--#{name}=#{value}"

    with {:ok, [_robot]} <- body(asked, word),
         {:ok, options} <-
           Options.parse(["--fleet=#{asked}", "--hardware=#{asked}", "--landmark=none" | more]),
         :ok <- free(link),
         {:ok, emulation} <- Emulation.start_link(Options.trial(options)),
         :ok <- shown(emulation, link) do
      watch(emulation, Hal.Clock.now_ms(), nil)
    end
  end

  defp body(asked, word) do
    with {:error, _allowed} <- Fleet.parse(asked),
         do: {:error, "#{word} is no body that can be emulated; bin/emulate --help names some"}
  end

  # What is of an emulation that was killed may go.
  defp free(link) do
    case File.lstat(link) do
      {:error, :enoent} -> :ok
      {:ok, %File.Stat{type: :symlink}} -> :ok
      {:ok, _other} -> {:error, "--link #{link} is there already, and is no link"}
      {:error, reason} -> {:error, "--link #{link}: #{:file.format_error(reason)}"}
    end
  end

  defp shown(emulation, link) do
    links =
      for {what, path} <- emulation.links,
          do: {what, path, if(what == "base", do: link, else: "#{link}.#{what}")}

    System.at_exit(fn _status -> for {_what, _path, own} <- links, do: File.rm(own) end)

    Enum.reduce_while(links, :ok, fn {what, path, own}, :ok ->
      _former = if match?({:ok, %{type: :symlink}}, File.lstat(own)), do: File.rm(own)

      case File.ln_s(path, own) do
        :ok ->
          IO.puts("#{what}: #{own}")
          {:cont, :ok}

        {:error, reason} ->
          {:halt, {:error, "--link #{own} cannot be made: #{:file.format_error(reason)}"}}
      end
    end)
  end

  # A line whenever the wheels begin to do something else, and once a second while they turn.
  defp watch(emulation, began_ms, told) do
    {pose, wheels} = Emulation.look(emulation)
    now_ms = Hal.Clock.now_ms() - began_ms
    said = {Format.decimals(wheels.linear, 2), Format.decimals(wheels.turn, 2)}
    second = if said != {"0.00", "0.00"}, do: div(now_ms, 1_000)

    if {said, second} != told do
      {linear, turn} = said
      degrees = Format.decimals(pose.heading * 180 / :math.pi(), 0)

      IO.puts(
        String.pad_leading(Format.decimals(now_ms / 1000, 1), 7) <>
          " s  wheels #{linear} m/s, #{turn} rad/s; body at #{Format.decimals(pose.x, 2)}, #{Format.decimals(pose.y, 2)}, #{degrees}°"
      )
    end

    receive do
    after
      @look_ms -> watch(emulation, began_ms, {said, second})
    end
  end
end
