defmodule Hal.Camera do
  @moduledoc """
  The behaviour of a source of frames, run by `Hal.Device`. The newest frame wins: an
  implementation never queues frames, but sends the next one when `next/1` asks for it. The device
  calls that once it has passed the last one on.
  """

  @typedoc "A picture; or, of a camera that detects by itself, what it found in one: a `Vision.Detections`."
  @type reading :: {:frame, Hal.Frame.t()} | {:detections, struct()}

  @doc "Opens the source."
  @callback init(keyword()) :: {:ok, state :: term()} | {:error, reason :: term()}

  @doc "Asks for one frame; it arrives as a message, and `handle_message/2` makes the reading of it."
  @callback next(state :: term()) :: {:ok, term()} | {:error, term(), term()}

  @doc "Turns one raw message into readings; unknown messages give `[]`."
  @callback handle_message(term(), state :: term()) ::
              {:ok, [reading()], term()} | {:error, term(), term()}

  @doc "An error that it gave with these options, in one line for people."
  @callback explain(reason :: term(), options :: keyword()) :: String.t()

  @doc "Closes the source."
  @callback terminate(state :: term()) :: :ok

  @doc "What options it takes; `mix robot.check` holds robot files against it."
  @callback option_table() :: Hal.Options.table()

  @optional_callbacks explain: 2, option_table: 0
end
