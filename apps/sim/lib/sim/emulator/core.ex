defmodule Sim.Emulator.Core do
  @moduledoc """
  Defines a device at the other end of a serial line, as a pure function of bytes, time and what its body senses.
  `Sim.Emulator` runs it on a pseudo-terminal. Times are whole milliseconds of one clock, and never go back.
  """

  @type core :: term()

  @typedoc "What the device commands its body to do."
  @type wish ::
          {:drive, Hal.Twist.t()}
          | {:look, pan :: float(), tilt :: float()}
          | {:zoom, field_of_view :: float()}

  @doc """
  The device, just switched on; the error is one line that names what is wrong with its options.
  """
  @callback new(options :: keyword(), at_ms :: integer()) ::
              {:ok, core()} | {:error, line :: String.t()}

  @doc "Bytes came over the line."
  @callback hear(core(), bytes :: binary(), at_ms :: integer()) :: core()

  @doc "The body reports something, as its driver passes it on."
  @callback feel(
              core(),
              reading :: Hal.Drive.reading() | Hal.Ptz.reading() | Hal.Lidar.reading(),
              at_ms :: integer()
            ) :: core()

  @doc "Advances the time: returns the bytes that are sent by now, and what the body should do."
  @callback run(core(), at_ms :: integer()) :: {bytes :: iodata(), [wish()], core()}

  @doc """
  The latest time at which it must act by itself; `nil` if it need not act before it hears
  something.
  """
  @callback next_ms(core()) :: integer() | nil

  @doc "Switches the device off and on."
  @callback restart(core(), at_ms :: integer()) :: core()

  @doc "For a base: the speed that its motors give its wheels at this time."
  @callback wheels(core(), at_ms :: integer()) :: Hal.Twist.t()

  @optional_callbacks wheels: 2
end
