defmodule Robot.Config.Speech do
  @moduledoc "Lists the options of `say:` in a robot's file (`Robot.Devices.Speech`)."
  alias Hal.Options

  @table [
    events: [{:list, {:text, "the name of a stage, such as \"formed\","}, 32}, required: true],
    program: [{:path, "the name or path of a program"}, default: "espeak-ng"],
    voice: [{:text, "a voice that the program has, such as \"en\","}, default: "en"]
  ]

  @doc "The table of the options."
  @spec table() :: Options.table()
  def table, do: @table

  @doc """
  Checks the options and adds the defaults.

      iex> Robot.Config.Speech.check(events: ["formed"])
      {:ok, [program: "espeak-ng", voice: "en", events: ["formed"]]}
  """
  @spec check(keyword()) :: {:ok, keyword()} | {:error, line :: String.t()}
  def check(options), do: Options.check(options, @table, "say")
end
