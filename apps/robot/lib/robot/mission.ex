defmodule Robot.Mission do
  @moduledoc """
  What a robot does over minutes: a pure state machine, run (`Robot.Mission.Runner`) by
  `Robot.Control.Pilot` in real time and by simulations in lockstep. It sends nothing, keeps no
  timers and reads no clock: deadlines are integers, compared with `percept.at_ms` at each tick.

  A stop is not for the mission: the pilot ends it, and hands it nothing more. What is left of it for the
  next start, if anything, is what `c:halted/1` says.
  """

  @type event ::
          {:tick, Robot.Percept.t()}
          | {:message, struct()}
          | {:outcome, tag :: term(), integer()}
          | {:command, command :: term()}

  @typedoc """
    * `{:goal, tag, {module, options} | nil}` - what to do from now on. The same tag again changes
      the options of the running behaviour, another one starts afresh; `nil` is idling
    * `{:anchors, anchors}` - what to find the pose by (`Robot.Localiser.Anchors`)
    * `{:look, pan}` - where the camera looks, radians, left positive, unless the behaviour cares
    * `{:send, to, message}` - say something to one robot, to several, or to `:all`
    * `{:claim, map}` - what the robot says of itself until further notice
    * `{:stage, name, map}` - something worth telling people happened
  """
  @type effect ::
          order()
          | {:send, to :: atom() | [atom()] | :all, struct()}
          | {:claim, map()}
          | {:stage, atom(), map()}

  @typedoc "An effect that the controller carries out (`Robot.Control.Controller.obey/2`)."
  @type order ::
          {:goal, tag :: term(), Robot.Behaviour.t() | {module(), keyword()} | nil}
          | {:anchors, Robot.Localiser.Anchors.t()}
          | {:look, pan :: float() | nil}

  @doc "Whether an effect is for the controller."
  defguard is_order(effect) when elem(effect, 0) in [:goal, :anchors, :look]

  @type result :: {phase :: atom(), mission :: term(), [effect()]}

  @doc "Starts the mission of this robot with options that `c:options/2` has checked."
  @callback init(robot :: atom(), keyword()) :: result()

  @doc "What happens next."
  @callback handle(event(), mission :: term()) :: result()

  @doc """
  What outlives a stop: the mission as it waits for its next `{:command, :start}`, with what people have
  asked of it so far. Asked once it is out of command; with `nil`, and without this callback, the next start begins from nothing.
  """
  @callback halted(mission :: term()) :: (mission :: term()) | nil

  @doc """
  The options of a start as people write them, checked and completed. `robots` is how many start together, `nil` where that is
  not known. What was checked once passes unchanged. A mission without this callback takes no options.
  """
  @callback options(keyword(), robots :: pos_integer() | nil) ::
              {:ok, keyword()} | {:error, line :: String.t()}

  @doc """
  What options a robot file may give it (`policies:`), as a table: `mix robot.check` and the robot's start name
  the line and the key of what is wrong. Of a mission without this callback only `c:options/2` is asked.
  """
  @callback option_table() :: Hal.Options.table()

  @optional_callbacks halted: 1, options: 2, option_table: 0
end
