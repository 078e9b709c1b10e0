defmodule Hal.Drive do
  @moduledoc """
  Defines what a drive base of any maker can do. With most bases one wire carries not only the
  wheels, but also the ranges, the bumpers and the battery, so a drive reports all of them as
  readings.

  `Hal.Device` runs an implementation, and calls every callback in its process. A callback returns
  a missing or failing device as an error, which `Hal.Device` retries with back-off; it does not
  raise.
  """

  @typedoc """
  A reading. Ranges are in metres, in the order of the profile's sensor poses; without an echo a
  range is the profile's greatest. Bumpers are the pressed segments, counted counter-clockwise
  from the front. Power is in volts. `:joystick` is the base's own: the speed to which it points, and whether its dead man's
  button is held; such readings come only while a person wants to drive by it. `:home` reports a switch at one absolute heading, as the
  heading of odometry there. Not every base has a brake, a joystick or such a switch; a receiver
  ignores readings that it does not know.

  Odometry and sonar readings come with a report of the base and are not repeated without one,
  because `Hal.Device.Reports` takes them for signs of life. A driver that receives a report but
  cannot make such a reading of it, because a conversion or the other half of the report is
  missing, gives `{:report, :wheels}` or `{:report, :sonar}`.

  What the base refuses is `{:refused, :drive, line}`, with the reason in one line; what it has
  done, `{:obeyed, :drive}`: `Hal.Device.Obedience` counts these, and tells them.
  """
  @type reading ::
          {:odometry, Hal.Odometry.t()}
          | {:sonar, [float()]}
          | {:ir, [float()]}
          | {:bumpers, [0..15]}
          | {:power, float()}
          | {:brake, boolean()}
          | {:joystick, %{twist: Hal.Twist.t(), held?: boolean()}}
          | {:home, heading :: float()}
          | {:report, :wheels | :sonar}
          | {:refused, request :: atom(), line :: String.t()}
          | {:obeyed, request :: atom()}
          | {:odd, line :: String.t()}

  @doc "Opens the line and stops the motors."
  @callback init(keyword()) :: {:ok, state :: term()} | {:error, reason :: term()}

  @doc "Sets the speed until the next call. The gate has limited it; a driver limits it again."
  @callback drive(Hal.Twist.t(), state :: term()) :: {:ok, term()} | {:error, term(), term()}

  @doc "Turns one raw message from the line into readings; unknown messages give `[]`."
  @callback handle_message(term(), state :: term()) ::
              {:ok, [reading()], term()} | {:error, term(), term()}

  @doc "Whether the drive may be armed; the error says what is missing, such as a conversion."
  @callback ready(state :: term()) :: :ok | {:error, line :: String.t()}

  @doc "Describes an error of this driver, opened with these options, in one line for people."
  @callback explain(reason :: term(), options :: keyword()) :: String.t()

  @typedoc """
  What the options alone say about a drive: whether it may be armed once it is open, which range
  sensors it reads, and which allowed settings are unusual, one line each with the usual value.
  """
  @type judgement :: %{
          ready: :ok | {:error, line :: String.t()},
          senses: [:sonar | :infrared],
          odd: [line :: String.t()]
        }

  @doc "Judges options before anything is opened, by the rules that `ready/1` applies later."
  @callback judge(keyword()) :: {:ok, judgement()} | {:error, line :: String.t()}

  @doc "Stops the motors and closes the line."
  @callback terminate(state :: term()) :: :ok

  @doc "The options that the driver takes; `mix robot.check` checks robot files against them."
  @callback option_table() :: Hal.Options.table()

  @doc """
  How long the sonars take until each has fired and was reported, in seconds, 0.0 to 2.0, by the options; these have a
  `profile:` here. The gate allows for a robot that has moved on meanwhile. Without this callback all fire at once.
  """
  @callback sonar_round_s(keyword()) :: float()

  @optional_callbacks explain: 2, ready: 1, judge: 1, option_table: 0, sonar_round_s: 1
end
