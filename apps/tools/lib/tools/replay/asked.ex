defmodule Tools.Replay.Asked do
  @moduledoc "Decides whether a recording has what the options of `mix replay` ask for. Pure."
  alias Console.Cli.Format
  alias Tools.Replay.Options
  alias Hal.Options.Suggest

  @doc "Checks the options against the names of the recorded robots and the time of the last entry; the error is one line."
  @spec check(Options.t(), robots :: [String.t()], last_s :: float()) ::
          :ok | {:error, line :: String.t()}
  def check(options, robots, last_s) do
    with :ok <- name("--robot", options.robot, robots),
         :ok <- name("--why", options.why, ["leader" | robots]),
         :ok <- time("--at", options.at_s, last_s),
         do: time("--until", options.until_s, last_s)
  end

  @doc "Whether a recording has a robot of this name. A text never becomes an atom."
  @spec name(String.t(), String.t() | nil, [String.t()]) :: :ok | {:error, line :: String.t()}
  def name(option, name, names) do
    if name == nil or name in names do
      :ok
    else
      {:error,
       "#{option} names no robot of the recording: #{name}; allowed are " <>
         Enum.join(names, ", ") <> Suggest.hint(name, names)}
    end
  end

  defp time(option, at_s, last_s) when at_s != nil and at_s > last_s,
    do:
      {:error,
       "#{option} #{at_s} is after the end of the recording, #{Format.decimals(last_s, 1)} s"}

  defp time(_option, _at_s, _last_s), do: :ok
end
