defmodule Hal.Lidar.Session do
  @moduledoc """
  Defines what is said to a lidar on a serial line, and what it answers, as a function of bytes and time (ms):
  `Hal.Lidar.Line` runs it.
  """

  @type t :: term()

  @typedoc "`{:error, reason}` ends the session; the line is closed, and opened again."
  @type effect ::
          {:write, binary()} | {:scan, Hal.Scan.t()} | {:odd, String.t()} | {:error, term()}

  @doc "A session on a line that was opened just now."
  @callback new(options :: keyword(), at_ms :: integer()) :: {[effect()], t()}

  @doc "Bytes came."
  @callback bytes(t(), binary(), at_ms :: integer()) :: {[effect()], t()}

  @doc "Time has passed, at least until `wake_ms/1`."
  @callback tick(t(), at_ms :: integer()) :: {[effect()], t()}

  @doc "When it must act by itself."
  @callback wake_ms(t()) :: integer()

  @doc "What stops the lidar."
  @callback stop(options :: keyword()) :: binary()
end
