defmodule Console.Replay.Asked do
  @moduledoc "Decides whether a recording has what the options of `mix replay` ask for. Pure."
  alias Console.Cli.Format
  alias Console.Replay.Options
  alias Hal.Options.Suggest
  alias Sim.Recording

  @doc "Checks the names of robots and the times; the error is one line."
  @spec check(Options.t(), Recording.File.t()) :: :ok | {:error, line :: String.t()}
  def check(options, file) do
    with :ok <- robots(options, file), do: times(options, Recording.File.last_ms(file) / 1000)
  end

  # Names become robots only by comparison: a text never becomes an atom.
  defp robots(options, %{setup: setup}) do
    names = for robot <- setup.robots, do: Atom.to_string(robot.id)

    [{"--robot", options.robot, names}, {"--why", options.why, ["leader" | names]}]
    |> Enum.find_value(:ok, fn {option, name, allowed} ->
      if name != nil and name not in allowed do
        {:error,
         "#{option} names no robot of the recording: #{name}; allowed are " <>
           Enum.join(allowed, ", ") <> Suggest.hint(name, allowed)}
      end
    end)
  end

  defp times(options, last_s) do
    Enum.find_value([{"--at", options.at_s}, {"--until", options.until_s}], :ok, fn {option, at_s} ->
      if at_s != nil and at_s > last_s,
        do:
          {:error,
           "#{option} #{at_s} is after the end of the recording, #{Format.decimals(last_s, 1)} s"}
    end)
  end
end
