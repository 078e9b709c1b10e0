defmodule Hal.Camera do
  @moduledoc """
  Defines a source of frames, run by `Hal.Device`. The newest frame wins: an implementation does not queue frames, but
  sends the next one when `next/1` asks for it. The device calls `next/1` after it has passed on the previous frame.
  """

  @typedoc """
  A picture or, from a camera that detects blobs itself, its detections (`Vision.Detections`); and
  what it refuses or has done, as in `Hal.Device.Obedience`.
  """
  @type reading ::
          {:frame, Hal.Frame.t()}
          | {:detections, struct()}
          | {:refused, request :: atom(), line :: String.t()}
          | {:obeyed, request :: atom()}
          | {:odd, line :: String.t()}

  @doc "Opens the source."
  @callback init(keyword()) :: {:ok, state :: term()} | {:error, reason :: term()}

  @doc """
  Asks for one frame, which arrives as a message that `handle_message/2` turns into a reading.
  """
  @callback next(state :: term()) :: {:ok, term()} | {:error, term(), term()}

  @doc "Turns one raw message into readings; unknown messages give `[]`."
  @callback handle_message(term(), state :: term()) ::
              {:ok, [reading()], term()} | {:error, term(), term()}

  @doc "Describes an error of this driver, opened with these options, in one line for people."
  @callback explain(reason :: term(), options :: keyword()) :: String.t()

  @doc "Closes the source."
  @callback terminate(state :: term()) :: :ok

  @doc "The options that the driver takes; `mix robot.check` checks robot files against them."
  @callback option_table() :: Hal.Options.table()

  @optional_callbacks explain: 2, option_table: 0
end
