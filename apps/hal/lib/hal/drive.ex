defmodule Hal.Drive do
  @moduledoc """
  What a drive base can do, whoever built it. One wire carries the wheels and, with most bases,
  the ranges, bumpers and the battery too, so a drive brings them all as readings.

  `Hal.Device` runs an implementation: every callback is called in its process. A missing or
  failing device is an error, which is retried with back-off; it is never a crash.
  """

  @typedoc """
  A reading. Ranges are metres, in the order of the profile's sensor poses; no echo is the
  profile's greatest range. Bumpers are the pressed segments, counted counter-clockwise from
  the front. Power is in volts. Not every base has a brake, a joystick, or a switch at one absolute
  heading (given as odometry's heading there); who does not know a reading leaves it alone.

  Odometry and sonar come with a report of the base and are not repeated without one: a base that tells
  neither is taken for silent (`Hal.Device.Reports`). A driver that hears a report and cannot make such a reading of it,
  for want of a conversion or of its other half, says `{:report, :wheels}` or `{:report, :sonar}`.
  """
  @type reading ::
          {:odometry, Hal.Odometry.t()}
          | {:sonar, [float()]}
          | {:ir, [float()]}
          | {:bumpers, [0..15]}
          | {:power, float()}
          | {:brake, boolean()}
          | {:joystick, %{x: integer(), y: integer(), buttons: byte()}}
          | {:home, heading :: float()}
          | {:report, :wheels | :sonar}

  @doc "Opens the line and stops the motors."
  @callback init(keyword()) :: {:ok, state :: term()} | {:error, reason :: term()}

  @doc "Sets the speed until the next call. The gate has limited it; a driver limits it again."
  @callback drive(Hal.Twist.t(), state :: term()) :: {:ok, term()} | {:error, term(), term()}

  @doc "Turns one raw message from the line into readings; unknown messages give `[]`."
  @callback handle_message(term(), state :: term()) ::
              {:ok, [reading()], term()} | {:error, term(), term()}

  @doc "Whether it may be armed: the line says what is missing, such as a conversion."
  @callback ready(state :: term()) :: :ok | {:error, line :: String.t()}

  @doc "An error that it gave with these options, in one line for people."
  @callback explain(reason :: term(), options :: keyword()) :: String.t()

  @typedoc """
  What options alone say of a drive: whether it may be armed once it is there, which senses it reads, and
  what is allowed and odd all the same, a line each with what would be usual.
  """
  @type judgement :: %{
          ready: :ok | {:error, line :: String.t()},
          senses: [:sonar | :infrared],
          odd: [line :: String.t()]
        }

  @doc "Judges options before anything is opened, by what `ready/1` goes by later."
  @callback judge(keyword()) :: {:ok, judgement()} | {:error, line :: String.t()}

  @doc "Stops the motors and closes the line."
  @callback terminate(state :: term()) :: :ok

  @doc "What options it takes; `mix robot.check` holds robot files against it."
  @callback option_table() :: Hal.Options.table()

  @optional_callbacks explain: 2, ready: 1, judge: 1, option_table: 0
end
