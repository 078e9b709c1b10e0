defmodule Swarm.EStop do
  @moduledoc """
  Stops a robot in an emergency: a role (`Robot.Role`) and a companion, with high priority and a mailbox of its own.
  Every stop of people and of other nodes arrives here (`:estop`, `:reset`, `:stop` and `:disarm`, calls of
  `Swarm.EStop.Broadcaster`) and goes to the gate at once, even if the comms process is flooded, hangs or is dead.

  It alone owns the state of the emergency stop (`Swarm.EStop.State`), and publishes it on the
  board under `:estop`, for all others to read. The only other copy is the gate's latch, which
  this process sets. A caller that stops the gate directly (`Robot.Safety.Gate.estop/1`; of ours `mix calibrate` alone) sets
  and clears it, too; the gate reports that by `:latch`, and this process follows.

  No other part decides, and none waits for this one: comms passes on what a
  heartbeat says if that differs from the board (`news?/2`), and is told of each change, so that
  the next heartbeats, which follow at once, spread it.

  A stop goes to gate, executive and pilot at once, so that one that hangs does not delay the
  others. The last of them, the gate, answers when the mission has ended and no older wish can
  follow (`Robot.Control.Pilot.halt/2`); if that does not happen, there is no answer. It
  is `:ok` once the base has reported since; if nothing reaches the wheels, or that is unknown, the answer
  says so, for stop, disarm and e-stop alike (`Swarm.EStop.Answer`).

  A reset first goes the same way: the gate is released once the robot's mission or order has
  ended, unless it is stopped again meanwhile.

  A stop is obeyed however old it is; a reset from another node bears a stamp
  (`Swarm.Order.Freshness`), which is requested here.

  As an input arrives, it gets what only a process knows (`arrive/3`): the time in microseconds, by which people's orders
  are dated, and the gate's latch with the number of its direct stops.
  """
  @behaviour Robot.Companion
  @behaviour Robot.Role
  alias Robot.{Board, Host, Names, Role}
  alias Robot.Control.Pilot
  alias Robot.Safety.Gate
  alias Swarm.Directory
  alias Swarm.EStop.{Answer, Broadcaster, Calls, State}
  alias Swarm.Order.{Freshness, Giver}
  alias Swarm.Wire.StopTags

  # The caller waits for half a second (`Swarm.Commands.Client`): a robot whose release no caller
  # would hear of stays held.
  @release_us 400_000
  @saved_ms 400
  # For so long a stop of a robot that is stopped makes no further call. A person cannot reset another robot in that time.
  @anew_us 100_000

  @enforce_keys [:robot, :boot, :stop, :presses]
  defstruct @enforce_keys ++
              [made: 0, pressed: 0, pressed_us: nil, sounded_us: nil, reset_us: nil]

  @typedoc """
  `boot` is the number of its life (`Robot.Config`), `made` counts its own calls; `pressed` counts the stops, the last at
  `pressed_us`; `presses` counts the direct stops of the gate that it has followed; `reset_us` is when the last reset that
  was carried out was given (all times monotonic, microseconds).
  """
  @type t :: %__MODULE__{
          robot: atom(),
          boot: integer(),
          stop: State.t(),
          presses: non_neg_integer(),
          made: non_neg_integer(),
          pressed: non_neg_integer(),
          pressed_us: integer() | nil,
          sounded_us: integer() | nil,
          reset_us: integer() | nil
        }

  @typedoc "A request: the stop that it was given after, when it was given, and the reference of the caller that waits."
  @type about :: {pressed(), given_us :: integer(), reference() | nil}
  @type pressed :: {boot :: integer(), pressed :: non_neg_integer()}

  @impl Robot.Companion
  def child_spec({config, _options}), do: Host.child_spec({__MODULE__, config})

  @doc "Passes on a call to stop that came from a node by datagram, to all robots of this node."
  @spec hear(node(), term()) :: :ok
  def hear(_node, {:estop, call, age_ms} = term) do
    if Calls.call?(call) and Calls.age?(age_ms),
      do: Enum.each(Names.all(:estop), &GenServer.cast(&1, term))

    :ok
  end

  def hear(_node, _malformed), do: :ok

  @doc "Whether the tags of a neighbour's heartbeat would change the state of the stop."
  @spec news?(State.t(), [State.tag()]) :: boolean()
  def news?(stop, tags), do: tags != [] and State.hear(stop, tags) != stop

  @doc """
  When the robot was last stopped, by any kind of stop (`System.monotonic_time/1`, microseconds);
  `nil` if never.
  """
  @spec stopped(Board.t() | Board.entries()) :: integer() | nil
  def stopped(board), do: read(board, :stopped)

  @doc "The state of the stop that the e-stop process published."
  @spec written(Board.t() | Board.entries()) :: State.t()
  def written(board), do: read(board, :estop) || State.new()

  defp read(board, key) do
    with {:ok, value, _at_ms} <- Board.fetch(board, key, :infinity, 0),
         do: value,
         else: (:error -> nil)
  end

  @doc "Whether a request is for the e-stop process; all others are for the comms process."
  @spec takes?(request :: term()) :: boolean()
  def takes?({:estop, _call}), do: true
  def takes?(request), do: request in [:stop, :disarm, :estop, :reset]

  @doc "The process that keeps the e-stop process of a robot in the directory, as a companion after it."
  @spec entry() :: Robot.Config.module_options()
  def entry, do: {Directory.Entry, role: :estop, all: :estops}

  @doc """
  Says whether the robot takes commands under its name, or no longer does because another of that
  name was first.
  """
  @spec present(robot :: atom(), boolean()) :: :ok
  def present(robot, present?), do: Directory.Entry.present(robot, :estop, present?)

  @impl Role
  def name, do: :estop

  @impl Role
  def period_ms, do: nil

  @impl Role
  def priority, do: :high

  # What the one before it recorded counts. Before the first did, the gate's latch, which has survived a restart of the
  # machine, is a stop of its own. A stop that was recorded may not have reached the gate; and a direct stop of the gate
  # since then has reached no other robot: its own cast follows that.
  @impl Role
  def init(%Robot.Config{id: id, boot: boot}, board, _at_ms) do
    published = read(board, :estop)

    presses = if published, do: read(board, :followed) || 0, else: Gate.presses(board)
    s = %__MODULE__{robot: id, boot: boot, stop: published || State.new(), presses: presses}

    s =
      if published == nil and Board.latched?(board) do
        {call, s} = call(s)
        %{s | stop: State.press(s.stop, call)}
      else
        s
      end

    {s, [written_effect(s), followed(s)] ++ latch(s) ++ [{:cast, :estop, :latch}]}
  end

  @doc """
  An input as it is handled, `{:cast, {:at, seen, message}}`: `seen` has the time `us`, and of the board whether the gate is
  `latched?`, and its `presses`; `by` of an order whose giver is known (`Swarm.Order.Giver`). What is malformed is unknown.
  """
  @impl Role
  def arrive({:cast, message}, now_us, board) do
    with whole when whole != :unknown <- whole(message) do
      seen = %{us: now_us, latched?: Board.latched?(board), presses: Gate.presses(board)}
      {:cast, {:at, Map.merge(seen, giver(message)), whole}}
    end
  end

  def arrive(_other, _now_us, _board), do: :unknown

  defp whole({:beat, tags} = message), do: if(StopTags.tags?(tags), do: message, else: :unknown)
  defp whole(:latch), do: :latch

  defp whole({:estop, call, age_ms} = message),
    do: if(Calls.call?(call) and Calls.age?(age_ms), do: message, else: :unknown)

  defp whole({:command, request, ref}), do: whole({:command, request, ref, nil})
  defp whole({:command, request, ref, order, _giver}), do: whole({:command, request, ref, order})

  # Without a reference nothing waits for an answer, as in lockstep, and it is not known from which node it comes.
  defp whole({:command, request, ref, order}) when ref == nil or is_reference(ref) do
    here? = ref != nil and node(ref) == node()
    {:command, request, ref, Freshness.arrived(order, here?)}
  end

  # From the robot's comms, which has determined when it was given.
  defp whole({:in_time, request, ref, given_us, _giver})
       when (ref == nil or is_reference(ref)) and is_integer(given_us),
       do: {:command, request, ref, {:asked, given_us}}

  defp whole({:release, about} = message), do: if(about?(about), do: message, else: :unknown)

  defp whole({:unlatched, _result, about} = message),
    do: if(about?(about), do: message, else: :unknown)

  defp whole({kind, ref} = message) when kind in [:stamp, :unsaved] and is_reference(ref),
    do: message

  defp whole(_unknown), do: :unknown

  # A stop needs no stamp, and has its giver there.
  defp giver({:command, _request, ref}), do: by(nil, ref)
  defp giver({:command, _request, ref, {:by, giver}}), do: by(giver, ref)
  defp giver({:command, _request, ref, _order}), do: by(nil, ref)
  defp giver({:command, _request, ref, _order, giver}), do: by(giver, ref)
  defp giver({:in_time, _request, _ref, _given_us, giver}), do: by(giver, nil)
  defp giver(_other), do: %{}

  defp by(giver, ref), do: if(by = Giver.of(giver, ref), do: %{by: by}, else: %{})

  defp about?({_pressed, given_us, ref}) when is_integer(given_us),
    do: ref == nil or is_reference(ref)

  defp about?(_other), do: false

  @impl Role
  def handle({:cast, {:at, seen, message}}, _at_ms, s, _board), do: take_in(message, seen, s)
  def handle(_unknown, _at_ms, _s, _board), do: :unknown

  # A neighbour's heartbeat carries the tags of the stops that hold it. A reset that was given before this is not meant
  # for it.
  defp take_in({:beat, tags}, seen, s) do
    stop = State.hear(s.stop, tags)
    become(if(stop == s.stop, do: s, else: pressed(s, seen)), stop, seen)
  end

  defp take_in(:latch, seen, s), do: follow(s, seen)
  defp take_in({:estop, call, age_ms}, seen, s), do: called(s, call, age_ms, seen)

  defp take_in({:command, request, ref, order}, seen, s) do
    case Freshness.judge(s.boot, request, order, true, seen.us, s.pressed_us) do
      {:ok, given_us} ->
        {s, effects} = obey(request, {{s.boot, s.pressed}, given_us, ref}, seen, s)
        {s, effects ++ tell(request, seen, s)}

      {:error, why} ->
        {s,
         [{:cast, :comms, {:rejected, :too_old}}] ++ answer(ref, Freshness.refusal(s.robot, why))}
    end
  end

  # The mission or order has ended: the gate may be released, if the sender of the reset still waits for the answer, and
  # if the robot was not stopped since.
  defp take_in({:release, {{boot, pressed}, given_us, _ref} = about}, seen, s)
       when boot == s.boot and pressed == s.pressed do
    if seen.us - given_us < @release_us,
      do: {s, [{:cast, :gate, {:unlatch, s.presses, about}}]},
      else: {s, []}
  end

  defp take_in({:release, {_pressed, _given_us, ref}}, _seen, s),
    do: {s, answer(ref, stopped_again(s))}

  defp take_in({:unlatched, :ok, {{boot, pressed}, given_us, ref}}, seen, s)
       when boot == s.boot and pressed == s.pressed do
    {s, effects} = reset(s, given_us, seen)
    {s, effects ++ answer(ref, :ok)}
  end

  # Stopped again meanwhile: the gate was latched again after the reset, or its report of a direct stop is on the way.
  defp take_in({:unlatched, _result, {_pressed, _given_us, ref}}, _seen, s),
    do: {s, answer(ref, stopped_again(s))}

  defp take_in({:stamp, ref}, seen, s), do: {s, answer(ref, Freshness.stamp(s.boot, seen.us))}
  defp take_in({:unsaved, ref}, _seen, s), do: {s, [{:apply, {Answer, :unsaved, [s.robot, ref]}}]}

  # Not from here: a log that hangs must delay no stop.
  defp tell(request, %{by: giver}, s) do
    said = [Names.via(s.robot, :comms), {:ordered, request, giver}]
    [{:apply, {GenServer, :cast, said}}]
  end

  defp tell(_request, _seen, _s), do: []

  # A mission that is slow to end does not delay an emergency stop.
  defp obey(:stop, {_pressed, _given_us, ref}, seen, s),
    do: {s, halt(ref && {Answer, :stood, [s.robot, ref]}, seen)}

  # The drive first confirms that its wheels are disarmed.
  defp obey(:disarm, {_pressed, _given_us, ref}, seen, s) do
    stopped = {Pilot, :halt, [s.robot, ref && {Answer, :stood, [s.robot, ref]}]}
    {s, halt(nil, seen) ++ [{:disarm, stopped}]}
  end

  defp obey(:reset, about, seen, %{stop: %{held: [_ | _]}} = s),
    do: {s, halt({:cast, :estop, {:release, about}}, seen)}

  # A robot that is not held drives on. The gate may have been stopped directly since the request.
  defp obey(:reset, {_pressed, _given_us, ref}, %{latched?: true} = seen, s) do
    {s, effects} = follow(s, seen)
    {s, answer(ref, {:error, "#{s.robot} was stopped meanwhile; reset it again"}) ++ effects}
  end

  defp obey(:reset, about, _seen, s), do: {s, [{:cast, :gate, {:unlatch, s.presses, about}}]}

  defp obey(:estop, {_pressed, _given_us, ref}, seen, s) do
    {s, effects} = press(s, seen)
    {s, effects ++ held(s, ref)}
  end

  defp obey({:estop, call}, {_pressed, _given_us, ref}, seen, s) do
    {s, effects} = if Calls.call?(call), do: called(s, call, 0, seen), else: {s, []}

    if State.held?(s.stop),
      do: {s, effects ++ held(s, ref)},
      else: {s, effects ++ answer(ref, {:error, "#{s.robot} was reset meanwhile"})}
  end

  defp obey(other, {_pressed, _given_us, ref}, _seen, s) do
    line = "#{inspect(other, limit: 5)} does not stop #{s.robot}; stop, disarm and estop do"
    {s, answer(ref, {:error, line})}
  end

  # A call to stop, from any source.
  defp called(s, call, age_ms, seen) do
    stop = State.call(s.stop, call)

    cond do
      stop == s.stop ->
        {s, []}

      # It was made before a person reset this robot: a distant robot was heard only now.
      s.reset_us != nil and 1_000 * age_ms > seen.us - s.reset_us ->
        s = %{s | stop: State.late(s.stop, call)}
        {s, [written_effect(s)]}

      true ->
        {s, effects} = become(pressed(s, seen), stop, seen)
        {s, effects ++ [{:apply, {Broadcaster, :pass_on, [call, age_ms]}}]}
    end
  end

  # Robots hear of a stop from their neighbours' heartbeats, too; but only a call says when it was
  # made, and a robot that is being reset at this moment must know that.
  defp press(%{stop: before} = s, seen) do
    {call, s} = call(s)
    {s, effects} = become(pressed(s, seen), State.press(before, call), seen)

    # Stops again and again are one call to the others; heartbeats tell the rest.
    if State.held?(before) and s.sounded_us != nil and seen.us - s.sounded_us < @anew_us,
      do: {s, effects},
      else: {%{s | sounded_us: seen.us}, effects ++ [{:apply, {Broadcaster, :sound, [call]}}]}
  end

  defp call(s), do: {{s.robot, s.boot, s.made + 1}, %{s | made: s.made + 1}}

  defp pressed(s, seen), do: %{s | pressed: s.pressed + 1, pressed_us: seen.us}

  defp reset(s, given_us, seen) do
    quiet = {:apply, {Broadcaster, :quiet, [s.stop.calls]}}
    {s, effects} = become(%{s | reset_us: given_us}, State.reset(s.stop), seen)
    {s, [quiet | effects]}
  end

  # Follows the gate, whose latch was set or cleared directly; the latch counts as it is now, not when the gate reported
  # it. It may have been set again although it was set: a reset that is being carried out was given before that.
  defp follow(%{presses: before} = s, seen) do
    s = %{s | presses: seen.presses}
    held? = State.held?(s.stop)

    {s, effects} =
      cond do
        seen.latched? and s.presses == before and held? -> {s, []}
        seen.latched? -> press(s, seen)
        held? -> reset(s, seen.us, seen)
        true -> {s, []}
      end

    # Only now: one that ends before this lets the next one press again.
    {s, effects ++ [followed(s)]}
  end

  # Sets the state of the stop: if it differs, it is recorded, carried out and spread. Recorded before the gate is told:
  # an e-stop process that restarts in between knows that there is a stop to carry out and to spread.
  defp become(%{stop: stop} = s, stop, _seen), do: {s, []}

  defp become(%{stop: before} = s, stop, seen) do
    s = %{s | stop: stop}
    # The mission ends with it: after the reset nothing moves until a person gives a command.
    ended = if State.held?(stop) and not State.held?(before), do: halt(nil, seen), else: []

    {s, [written_effect(s)] ++ latch(s) ++ ended ++ [{:cast, :comms, :stop}]}
  end

  # A reset that is on its way to the gate comes before this.
  defp latch(s), do: if(State.held?(s.stop), do: [{:cast, :gate, {:latch, nil}}], else: [])

  # As `Robot.Control.Pilot.halt_at_once/2`. Requests from before this stop begin nothing after it
  # (`Swarm.Order.Freshness`, `Robot.Control.Pilot`).
  defp halt(then, seen) do
    token = {:estop, seen.us}

    [{:put, :stopped, seen.us}, {:cast, :gate, {:forget, nil}}] ++
      [{:cast, :executive, {:hold, token}}, {:cast, :pilot, {:halt, token, then}}]
  end

  # Answers an e-stop once the gate is latched, and once that is in its file, if it has one; or that gate or disk take too long.
  defp held(_s, nil), do: []

  defp held(s, ref) do
    [{:after, @saved_ms, {:unsaved, ref}}] ++
      [{:cast, :gate, {:latch, {Answer, :latched, [s.robot, ref]}}}]
  end

  defp answer(ref, answer), do: [{:reply, ref, answer}]

  defp stopped_again(s), do: {:error, "#{s.robot} was stopped again meanwhile; reset it again"}

  defp written_effect(s), do: {:put, :estop, s.stop}
  defp followed(s), do: {:put, :followed, s.presses}
end
