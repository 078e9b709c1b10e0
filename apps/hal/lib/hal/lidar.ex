defmodule Hal.Lidar do
  @moduledoc """
  Defines what a lidar can do that turns in a plane. Run by `Hal.Device`, like `Hal.Drive`, with `kind: :scan`.
  """

  @typedoc "A whole turn, or what it saw of one. `{:odd, line}` is told once."
  @type reading :: {:scan, Hal.Scan.t()} | {:odd, line :: String.t()}

  @doc "Opens the line, and lets it turn."
  @callback init(keyword()) :: {:ok, state :: term()} | {:error, reason :: term()}

  @doc "Turns one raw message from the line into readings; unknown messages give `[]`."
  @callback handle_message(term(), state :: term()) ::
              {:ok, [reading()], term()} | {:error, term(), term()}

  @doc "Describes an error of this driver, opened with these options, in one line for people."
  @callback explain(reason :: term(), options :: keyword()) :: String.t()

  @doc "Stops it, and closes the line."
  @callback terminate(state :: term()) :: :ok

  @doc "The options that the driver takes; `mix robot.check` checks robot files against them."
  @callback option_table() :: Hal.Options.table()

  @optional_callbacks explain: 2, option_table: 0
end
