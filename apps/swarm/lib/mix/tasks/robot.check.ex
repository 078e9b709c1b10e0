defmodule Mix.Tasks.Robot.Check do
  @shortdoc "Checks robot files, and says what each robot is"
  @moduledoc """
  Checks robot files, and summarises each robot: its speeds, its stopping distance, its sensors,
  when its wheels may turn.

      mix robot.check [FILE…]

  Without a FILE, all of `config/robots`. It reports all errors at once, each on a line
  `file:line: key: what is allowed`; the exit status is then 1. An allowed but unusual value gets
  a WARNING, with the usual value. `docs/robots.md` describes the keys.

  `--help` lists the options.
  """
  use Mix.Task
  alias Robot.File.Summary
  alias Swarm.MemberSpec

  @impl Mix.Task
  def run(words) do
    Hal.Cli.Command.run("robot.check", words, {@moduledoc, []}, fn
      _options, [] -> files(Path.wildcard("config/robots/*.exs"))
      _options, files -> files(files)
    end)
  end

  defp files([]), do: {:error, "no robot file is in config/robots; name one"}

  defp files(files) do
    problems = Enum.flat_map(files, &check/1)
    if problems != [], do: {:error, problems}
  end

  defp check(file) do
    with {:ok, robot} <- MemberSpec.load(file),
         {:ok, _config} <- MemberSpec.config(robot) do
      [title | lines] = Summary.report(file, robot)
      Enum.each([title | Enum.map(lines, &"  #{&1}")], fn line -> Mix.shell().info(line) end)

      []
    else
      {:error, line} when is_binary(line) -> ["#{file}: #{line}"]
      {:error, lines} -> lines
    end
  end
end
