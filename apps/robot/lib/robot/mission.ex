defmodule Robot.Mission do
  @moduledoc """
  Describes what a robot does over minutes: a pure state machine, run by `Robot.Control.Pilot` in real time
  and by simulations in lockstep (`Robot.Mission.Runner`). It sends nothing, keeps no timers and
  reads no clock: deadlines are integers, compared with `percept.at_ms` at each tick.

  A mission does not handle stops: the pilot ends it and passes it no more events. `c:halted/1`
  returns what remains of it for the next start, if anything.
  """

  @type event ::
          {:tick, Robot.Percept.t()}
          | {:message,
             %{:from => atom(), :kind => atom(), :body => term(), optional(atom()) => term()}}
          | {:outcome, tag :: term(), integer()}
          | {:command, command :: term()}

  @typedoc """
    * `{:goal, tag, {module, options} | nil}` - the goal from now on. The same tag and module
      again change the options of the running behaviour, others start afresh; `nil` drops the goal
    * `{:anchors, anchors}` - the references for the pose (`Robot.Localiser.Anchors`)
    * `{:look, pan}` - where the camera looks, radians, left positive, unless the behaviour
      decides
    * `{:tell, to, kind, fields}` - sends a message of the mission's own (`c:messages/0`) to one robot, to
      several, or to `:all`
    * `{:send, to, message}` - sends a message that all robots share (`Swarm.Message`) likewise
    * `{:claim, map}` - what the robot reports about itself until the next claim: `phase:`, `standing:`, `leader:` and the fields
      of `c:claims/0` go to all robots; for people there are `blocked_by:` and `says:`, each a line or `nil`, which
      stand in its status, and `formed:`, that it has what the mission wants, which ends a run of the demo
    * `{:claim, to, map}` - says such fields of `c:claims/0` at once to one robot, to several, or to `:all`, and to no other
    * `{:stage, name, map}` - reports an event to people; `says:` is how it is told, after the robot's name
  """
  @type effect ::
          order()
          | {:tell, to :: atom() | [atom()] | :all, kind :: atom(), fields :: keyword()}
          | {:send, to :: atom() | [atom()] | :all, struct()}
          | {:claim, map()}
          | {:claim, to :: atom() | [atom()] | :all, map()}
          | {:stage, atom(), map()}

  @typedoc "An effect that the controller carries out (`Robot.Control.Controller.obey/2`)."
  @type order ::
          {:goal, tag :: term(), Robot.Behaviour.t() | {module(), keyword()} | nil}
          | {:anchors, Robot.Localiser.Anchors.t()}
          | {:look, pan :: float() | nil}

  @doc "Whether an effect is for the controller."
  defguard is_order(effect) when elem(effect, 0) in [:goal, :anchors, :look]

  @type result :: {phase :: atom(), mission :: term(), [effect()]}

  @doc "Starts the mission of this robot with options as `c:options/2` returns them."
  @callback init(robot :: atom(), keyword()) :: result()

  @doc "Handles an event."
  @callback handle(event(), mission :: term()) :: result()

  @doc """
  What remains after a stop: the mission as it waits for its next `{:command, :start}`, with the
  commands that it keeps. Called when the stop has ended the mission. If it returns `nil`, or
  without this callback, the mission cannot be resumed.
  """
  @callback halted(mission :: term()) :: (mission :: term()) | nil

  @doc """
  Checks and completes the options of a start as people write them. `robots` is how many robots
  start together, `nil` if that is not known. Options that were checked before must pass
  unchanged. Only for what a table cannot say: a mission without this callback takes the options
  of its `c:option_table/0`, and none without a table.
  """
  @callback options(keyword(), robots :: pos_integer() | nil) ::
              {:ok, keyword()} | {:error, line :: String.t()}

  @doc """
  The options of the mission as a table. From it people can give them as text
  (`bin/demo --mission patrol:period=90`), and `mix robot.check` can name the line and the key of an
  error in a robot file. For a mission without this callback only `c:options/2` is called.
  """
  @callback option_table() :: Hal.Options.table()

  @doc """
  What the mission knows and has decided, in lines with labels, for people who ask why a robot did
  something (`mix replay --why`).
  """
  @callback explain(mission :: term()) :: [{label :: String.t(), text :: String.t()}]

  @typedoc """
  The version of a mission's messages, and what it hears: a table for each kind of its own, `:shared` for
  a kind that all robots share (`Swarm.Message`).
  """
  @type messages :: {version :: pos_integer(), [{kind :: atom(), Hal.Options.table() | :shared}]}

  @doc """
  The messages that the mission hears, and says by `{:tell, to, kind, fields}` (`Robot.Mission.Letter`). Robots
  whose missions have another version here do not hear each other. A mission without this callback has
  no messages of its own.
  """
  @callback messages() :: messages()

  @typedoc """
  The version of what a mission claims, and the module of the struct that it is. Its `valid?/1` says whether one from outside,
  which has the right keys, makes sense.
  """
  @type claims :: {version :: 1..65_535, struct :: module()}

  @doc """
  What every heartbeat of a robot says of this mission beside its phase, whether it stands, and which robot it follows
  (`Robot.Mission.Claim`). Others hear it in `percept.peers` as `peer.beat.claim`. A mission without this callback has nothing
  more to say.
  """
  @callback claims() :: claims()

  @doc """
  What the mission may still claim when it has decided nothing for more than a second, as after a freeze. Without this callback:
  what it claimed last.
  """
  @callback stale(claim :: map()) :: map()

  @doc """
  The names of the commands for a running mission that it understands, beside `:start`, such as `[:formation]`. People are
  told that a robot does not take the others. A mission without this callback gets every command. One that names a command
  for one robot, such as `:move` (`Robot.Command`), gets that, too; without that the robot leaves the mission for it.

  One that names a kind of its messages (`c:messages/0`) hears that kind from people, too, checked by its table, as
  `{:command, {:message, kind, fields}}`: a person is no robot, so nothing that people write comes as a message of one.
  """
  @callback commands() :: [atom()]

  @typedoc "What a robot does for its group in a phase, or has done when it reports a stage."
  @type role :: :leads | :follows | :searches | :rests | :elects

  @doc """
  The roles of the mission's phases and stages, for judging whole runs. A search is one stage of all robots; one
  that `:rests` has nothing to do. A mission without this callback has no such phases.
  """
  @callback roles() :: %{(phase_or_stage :: atom()) => role()}

  @typedoc """
  What a claim says, for judging whole runs: `state:` what the robot does, in one word for people, which is a phase that
  `:follows` only while a follower is under way to its place; `says:` what it says of that place; `sight:` how large it sees
  what the mission looks for (millionths of its picture), and how far off (mm), `nil` if it does not.
  """
  @type account :: %{
          state: atom(),
          says: [:in_place | :unsure | :blocked],
          sight: %{:size_ppm => non_neg_integer(), :distance => non_neg_integer() | nil} | nil
        }

  @doc "What a claim says. Without this callback: its phase, and nothing else."
  @callback account(claim :: map()) :: account()

  @typedoc "A shape, and the number and pose of each robot's place in it."
  @type shape :: %{
          formation: {kind :: atom(), spacing_m :: float()},
          slots: %{(robot :: atom()) => {number :: pos_integer(), Hal.Pose.t()}}
        }

  @doc """
  What a leader with this claim means each robot's place to be, if it stands at `pose` and what it leads them to is so many
  metres ahead; `nil` if it says nothing of that. Without this callback robots have no places.
  """
  @callback shape(claim :: map(), pose :: Hal.Pose.t(), ahead_m :: float()) :: shape() | nil

  @doc """
  The place that the robot takes now, which no other robot may take, too; or what is wrong with the places that it gives to
  others, in one line; `nil` for neither. Without this callback: `nil`.
  """
  @callback place(mission :: term(), at_ms :: integer()) ::
              {:slot, term()} | {:fault, line :: String.t()} | nil

  @typedoc """
  What a mission draws over the map of its robots, in metres, in the frame of its robot's pose: lines through points, points with a label,
  and square cells of a size by their middles, each with a name that says what it is.
  """
  @type layer :: [
          {:polyline, name :: String.t(), [Hal.Pose.point()]}
          | {:points, name :: String.t(), [{x :: float(), y :: float(), label :: String.t()}]}
          | {:cells, name :: String.t(), size_m :: float(), [Hal.Pose.point()]}
        ]

  @doc """
  What people are shown over the map of what the mission has to do, such as its points: by the page, in pictures and in recordings
  of runs. It is asked at each event. Without this callback: nothing.
  """
  @callback layer(mission :: term()) :: layer()

  @doc "All phases, for files that name one. Without this callback: those of `c:roles/0`."
  @callback phases() :: [atom()]

  @doc "The map that the mission has made so far, for a file (`Nav.MapFile.save/2`)."
  @callback map(mission :: term()) :: Nav.MapFile.Writer.raster()

  @optional_callbacks halted: 1,
                      options: 2,
                      option_table: 0,
                      explain: 1,
                      messages: 0,
                      claims: 0,
                      stale: 1,
                      commands: 0,
                      roles: 0,
                      account: 1,
                      shape: 3,
                      place: 2,
                      layer: 1,
                      phases: 0,
                      map: 1

  @doc """
  Whether a module is a mission: it is part of this build and declares this behaviour.

      iex> for module <- [Robot.Mission.Manual, Robot.Percept, :no_such_module],
      ...>   do: Robot.Mission.mission?(module)
      [true, false, false]
  """
  @spec mission?(module()) :: boolean()
  def mission?(module) do
    Code.ensure_loaded?(module) and
      Enum.any?(module.module_info(:attributes), fn {key, value} ->
        key == :behaviour and __MODULE__ in value
      end)
  end

  @doc "Whether a mission takes this command while it runs (`c:commands/0`)."
  @spec understands?(module(), command :: atom()) :: boolean()
  def understands?(module, command),
    do: not function_exported?(module, :commands, 0) or command in module.commands()

  @doc """
  Whether a mission names this command among its own.

      iex> Robot.Mission.names?(Robot.Mission.Manual, :move)
      false
  """
  @spec names?(module(), command :: atom()) :: boolean()
  def names?(module, command),
    do: function_exported?(module, :commands, 0) and command in module.commands()

  @doc "The roles of a mission's phases and stages (`c:roles/0`)."
  @spec roles(module()) :: %{atom() => role()}
  def roles(module), do: if(has?(module, :roles, 0), do: module.roles(), else: %{})

  @doc """
  What a claim of this mission says (`c:account/1`).

      iex> for claim <- [%{phase: :goto}, %{}], do: Robot.Mission.account(Robot.Mission.Manual, claim).state
      [:goto, :idle]
  """
  @spec account(module(), claim :: map()) :: account()
  def account(module, claim) do
    if has?(module, :account, 1),
      do: module.account(claim),
      else: %{state: Map.get(claim, :phase, :idle), says: [], sight: nil}
  end

  @doc "What a leader means each robot's place to be (`c:shape/3`)."
  @spec shape(module(), claim :: map(), Hal.Pose.t(), float()) :: shape() | nil
  def shape(module, claim, pose, ahead_m),
    do: if(has?(module, :shape, 3), do: module.shape(claim, pose, ahead_m))

  @doc "The place that a robot takes, or what is wrong with those that it gives (`c:place/2`)."
  @spec place(module(), mission :: term(), integer()) ::
          {:slot, term()} | {:fault, String.t()} | nil
  def place(module, mission, at_ms),
    do: if(has?(module, :place, 2), do: module.place(mission, at_ms))

  @doc "The phases of a mission (`c:phases/0`)."
  @spec phases(module()) :: [atom()]
  def phases(module),
    do: if(has?(module, :phases, 0), do: module.phases(), else: Map.keys(roles(module)))

  defp has?(module, callback, arity),
    do: Code.ensure_loaded?(module) and function_exported?(module, callback, arity)

  @doc "Whether a mission says what its options are."
  @spec checks?(module()) :: boolean()
  def checks?(module),
    do: function_exported?(module, :options, 2) or function_exported?(module, :option_table, 0)

  @doc """
  The options of a start, checked and completed by the mission, or else by its table; the error is
  one line. A mission whose claims no robot could check is refused as well (`Robot.Mission.Claim.fault/1`).

      iex> Robot.Mission.check_options(Robot.Mission.Manual, [speed: 1], nil)
      {:error, "manual takes no options"}
  """
  @spec check_options(module(), keyword(), robots :: pos_integer() | nil) ::
          {:ok, keyword()} | {:error, line :: String.t()}
  def check_options(module, options, robots) do
    _loaded? = Code.ensure_loaded?(module)
    fault = Robot.Mission.Claim.fault(module)

    cond do
      fault != nil ->
        {:error, "#{subject(module)} #{fault}"}

      function_exported?(module, :options, 2) ->
        checked(module, module.options(options, robots))

      function_exported?(module, :option_table, 0) ->
        Hal.Options.check(options, module.option_table(), subject(module))

      options == [] ->
        {:ok, []}

      true ->
        {:error, "#{subject(module)} takes no options"}
    end
  end

  defp checked(_module, {:error, line} = error) when is_binary(line), do: error

  defp checked(module, answer) do
    with {:ok, options} <- answer, true <- Keyword.keyword?(options) do
      {:ok, options}
    else
      _other -> {:error, "#{inspect(module)}.options/2 returned neither options nor an error"}
    end
  end

  @doc """
  The name in messages of a mission without a configured name.

      iex> Robot.Mission.subject(Robot.Mission.Manual)
      "manual"
  """
  @spec subject(module()) :: String.t()
  def subject(module),
    do: module |> inspect() |> String.split(".") |> List.last() |> Macro.underscore()
end
