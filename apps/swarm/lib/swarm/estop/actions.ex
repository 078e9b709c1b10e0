defmodule Swarm.EStop.Actions do
  @moduledoc false
  # Carries out the actions of a robot's e-stop process (`Swarm.EStop`): stops, releases, records the state of the stop,
  # and spreads it.
  alias Hal.Device
  alias Robot.{Board, Names}
  alias Robot.Control.Pilot
  alias Robot.Safety.Gate
  alias Mesh.Nonblocking
  alias Swarm.EStop
  alias Swarm.EStop.Broadcaster

  # The caller waits for half a second (`Swarm.Commands.Client`): a robot whose release nobody
  # would hear of stays held.
  @release_us 400_000
  # For so long a stop of a robot that is stopped makes no further call. Nobody resets another robot in that time.
  @anew_us 100_000

  @typedoc """
  `pressed` identifies the last time that somebody stopped it, at `pressed_us`; `reset_us` is when
  the last reset that was carried out was given (both monotonic, microseconds).
  """
  @type t :: %{
          :config => Robot.Config.t(),
          :id => atom(),
          :board => Board.t(),
          :stop => EStop.State.t(),
          :pressed => reference(),
          :pressed_us => integer() | nil,
          :reset_us => integer() | nil,
          :presses => non_neg_integer(),
          :sounded_us => integer() | nil,
          optional(atom()) => term()
        }

  @doc "The state of the stop that the e-stop process published."
  @spec written(Board.t()) :: EStop.State.t()
  def written(board), do: published(board) || EStop.State.new()

  @doc """
  The state with which an e-stop process begins, and the direct stop of the gate that it has followed: what the one
  before it recorded; before the first did, the gate's latch, which has survived a restart, is a stop of its own.
  """
  @spec begin(Board.t()) :: {EStop.State.t(), presses :: non_neg_integer()}
  def begin(board) do
    cond do
      stop = published(board) ->
        {stop, followed(board)}

      Board.latched?(board) ->
        {EStop.State.press(EStop.State.new(), Broadcaster.call()), Gate.presses(board)}

      true ->
        {EStop.State.new(), Gate.presses(board)}
    end
  end

  defp followed(board) do
    with {:ok, presses, _at_ms} <- Board.fetch(board, :followed, :infinity),
         do: presses,
         else: (:error -> 0)
  end

  defp published(board) do
    with {:ok, stop, _at_ms} <- Board.fetch(board, :estop, :infinity),
         do: stop,
         else: (:error -> nil)
  end

  @doc """
  Carries out a request, and answers it. This waits for nobody: a mission that is slow to end does
  not delay an emergency stop.
  """
  @spec obey(t(), request :: term(), {reference(), given_us :: integer()}) :: t()
  def obey(s, request, about)

  def obey(s, :stop, {ref, _given_us}) do
    halt(s, {EStop.Answer, :stood, [s.id, ref]})
    s
  end

  # The drive first confirms that its wheels are disarmed.
  def obey(s, :disarm, {ref, _given_us}) do
    halt(s, nil)
    stopped = {Pilot, :halt, [s.id, {EStop.Answer, :stood, [s.id, ref]}]}
    :ok = Device.disarm_later(Names.via(s.id, :drive), stopped)
    s
  end

  def obey(%{stop: %{held: [_ | _]}} = s, :reset, about) do
    halt(s, {EStop.Answer, :release, [s.id, s.pressed, about]})
    s
  end

  # A robot that is not held drives on. The gate may have been stopped directly since the request.
  def obey(s, :reset, {ref, given_us}) do
    if Board.latched?(s.board) do
      Nonblocking.answer(ref, {:error, "#{s.id} was stopped meanwhile; reset it again"})
      follow(s)
    else
      release(s, {ref, given_us})
      s
    end
  end

  def obey(s, :estop, {ref, _given_us}) do
    s = press(s)
    EStop.Answer.held(s.id, ref)
    s
  end

  def obey(s, {:estop, call}, {ref, _given_us}) do
    s = called(s, call, 0)

    if EStop.State.held?(s.stop),
      do: EStop.Answer.held(s.id, ref),
      else: Nonblocking.answer(ref, {:error, "#{s.id} was reset meanwhile"})

    s
  end

  def obey(s, other, {ref, _given_us}) do
    line = "#{inspect(other, limit: 5)} does not stop #{s.id}; stop, disarm and estop do"

    Nonblocking.answer(ref, {:error, line})
    s
  end

  @doc "Handles a call to stop, from any source."
  @spec called(t(), call :: term(), age_ms :: term()) :: t()
  def called(s, call, age_ms) do
    with true <- EStop.Calls.call?(call) and EStop.Calls.age?(age_ms),
         stop when stop != s.stop <- EStop.State.call(s.stop, call) do
      if over?(s, age_ms) do
        write(%{s | stop: EStop.State.late(s.stop, call)})
      else
        s = become(pressed(s), stop)
        Broadcaster.pass_on(call, age_ms)
        s
      end
    else
      _malformed_or_heard_before -> s
    end
  end

  defp pressed(s), do: %{s | pressed: make_ref(), pressed_us: now_us()}

  # Robots hear of a stop from their neighbours' heartbeats, too; but only a call says when it was
  # made, and a robot that is being reset at this moment must know that.
  defp press(%{stop: before} = s) do
    call = Broadcaster.call()
    s = become(pressed(s), EStop.State.press(before, call))

    # Stops again and again are one call to the others; heartbeats tell the rest.
    if EStop.State.held?(before) and s.sounded_us != nil and now_us() - s.sounded_us < @anew_us do
      s
    else
      :ok = Broadcaster.sound(call)
      %{s | sounded_us: now_us()}
    end
  end

  @doc "A neighbour's heartbeat carries the tags of the stops that hold it."
  @spec heard(t(), [EStop.State.tag()]) :: t()
  def heard(%{stop: before} = s, tags) do
    stop = EStop.State.hear(before, tags)
    # A reset that was given before this is not meant for it.
    s = if stop != before, do: pressed(s), else: s
    become(s, stop)
  end

  @doc "Releases the gate, by a reset that was given then; the gate answers with `{:unlatched, result, about}`."
  @spec release(t(), {reference(), given_us :: integer()}) :: :ok
  def release(s, about), do: Gate.unlatch(s.id, s.presses, {s.pressed, about})

  @doc "Answers a reset by what the gate has answered."
  @spec released(t(), :ok | {:error, :pressed}, {reference(), {reference(), integer()}}) :: t()
  def released(%{pressed: pressed} = s, :ok, {pressed, {ref, given_us}}) do
    s = reset(s, given_us)
    Nonblocking.answer(ref, :ok)
    s
  end

  # Stopped again meanwhile: the gate was latched again after the reset, or its report of a direct stop is on the way.
  def released(s, _result, {_pressed, {ref, _given_us}}) do
    EStop.Answer.stopped_again(s.id, ref)
    s
  end

  defp reset(s, given_us) do
    Broadcaster.quiet(s.stop.calls)
    become(%{s | reset_us: given_us}, EStop.State.reset(s.stop))
  end

  @doc "Whether the sender of a reset that was given then still waits for the answer."
  @spec waits?(given_us :: integer()) :: boolean()
  def waits?(given_us), do: now_us() - given_us < @release_us

  defp halt(%{id: id} = s, then) do
    # Requests from before this stop begin nothing after it (`Swarm.Order.Freshness`,
    # `Robot.Control.Pilot`).
    Board.put(s.board, :estop, :stopped, now_us(), Robot.Config.now(s.config))
    :ok = Pilot.halt_at_once(id, then)
  end

  # The call was made before a person reset this robot: somebody far away was heard only now.
  defp over?(%{reset_us: nil}, _age_ms), do: false
  defp over?(%{reset_us: reset_us}, age_ms), do: 1_000 * age_ms > now_us() - reset_us

  defp now_us, do: System.monotonic_time(:microsecond)

  # Sets the state of the stop: if it differs, it is recorded, carried out and spread.
  defp become(%{stop: stop} = s, stop), do: s

  # Recorded before the gate is told: an e-stop process that restarts in between knows that there
  # is a stop to carry out and to spread.
  defp become(%{stop: before} = s, stop) do
    s = hold(write(%{s | stop: stop}))

    # The mission ends with it: after the reset nothing moves until somebody gives a command.
    if EStop.State.held?(stop) and not EStop.State.held?(before), do: halt(s, nil)

    GenServer.cast(Names.via(s.id, :comms), :stop)
    s
  end

  @doc "Latches the gate if the stop is set. A reset that is on its way to the gate comes before this."
  @spec hold(t()) :: t()
  def hold(s) do
    if EStop.State.held?(s.stop), do: Gate.latch(s.id)
    s
  end

  @doc """
  Follows the gate, whose latch was set or cleared directly; the latch counts as it is now. It may have
  been set again although it was set: a reset that is being carried out was given before that.
  """
  @spec follow(t()) :: t()
  def follow(%{presses: before} = s) do
    s = %{s | presses: Gate.presses(s.board)}

    s =
      cond do
        Board.latched?(s.board) and s.presses == before and EStop.State.held?(s.stop) -> s
        Board.latched?(s.board) -> press(s)
        EStop.State.held?(s.stop) -> reset(s, now_us())
        true -> s
      end

    # Only now: one that ends before this lets the next one press again.
    record(s)
  end

  @doc "Records the state of the stop."
  @spec write(t()) :: t()
  def write(s) do
    Board.put(s.board, :estop, :estop, s.stop, Robot.Config.now(s.config))
    s
  end

  @doc "Records which direct stop of the gate was followed."
  @spec record(t()) :: t()
  def record(s) do
    Board.put(s.board, :estop, :followed, s.presses, Robot.Config.now(s.config))
    s
  end
end
