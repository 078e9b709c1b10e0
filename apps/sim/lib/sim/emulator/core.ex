defmodule Sim.Emulator.Core do
  @moduledoc """
  A device at the other end of a serial line, as a pure function of bytes, time and what its body feels.
  `Sim.Emulator` runs it on a pseudo-terminal. Times are whole milliseconds of one clock, and never go back.
  """

  @type core :: term()

  @typedoc "What the device wants of its body."
  @type wish ::
          {:drive, Hal.Twist.t()}
          | {:look, pan :: float(), tilt :: float()}
          | {:zoom, field_of_view :: float()}

  @doc "The device, just switched on; or one line that names what is wrong with its options."
  @callback new(options :: keyword(), at_ms :: integer()) ::
              {:ok, core()} | {:error, line :: String.t()}

  @doc "Bytes came over the line."
  @callback hear(core(), bytes :: binary(), at_ms :: integer()) :: core()

  @doc "The body says something, as its driver hands it on."
  @callback feel(core(), reading :: Hal.Drive.reading() | Hal.Ptz.reading(), at_ms :: integer()) ::
              core()

  @doc "Time has come so far: the bytes that are sent by now, and what the body is to do."
  @callback run(core(), at_ms :: integer()) :: {bytes :: iodata(), [wish()], core()}

  @doc "When it has something to do by itself, at the latest; `nil` when not before it hears something."
  @callback next_ms(core()) :: integer() | nil

  @doc "It was switched off and on."
  @callback restart(core(), at_ms :: integer()) :: core()
end
