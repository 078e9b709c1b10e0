defmodule Swarm.EStop.Actions do
  @moduledoc """
  What a robot's e-stop process does (`Swarm.EStop`): stops, releases, records how the stop stands, and spreads it.
  """
  alias Hal.Device
  alias Robot.{Board, Config, Names}
  alias Robot.Control.{Executive, Pilot}
  alias Robot.Safety.Gate
  alias Mesh.Nonblocking
  alias Swarm.EStop
  alias Swarm.EStop.Broadcaster

  # Whoever asks has half a second (`Swarm.Commands.Client`): a robot that nobody was told of stays held.
  @release_us 400_000

  @typedoc """
  `pressed` stands for the last time that somebody stopped it, at `pressed_us`; `reset_us` is when the last reset that was
  carried out was given (both monotonic, microseconds).
  """
  @type t :: %{
          :config => Config.t(),
          :id => atom(),
          :board => Board.t(),
          :stop => EStop.State.t(),
          :pressed => reference(),
          :pressed_us => integer() | nil,
          :reset_us => integer() | nil,
          optional(atom()) => term()
        }

  @doc "How the stop stands as the e-stop process published it; before the first did, by the gate's latch."
  @spec written(Board.t()) :: EStop.State.t()
  def written(board) do
    case Board.fetch(board, :estop, :infinity) do
      {:ok, stop, _at_ms} -> stop
      :error -> EStop.State.new(Board.latched?(board))
    end
  end

  @doc """
  Obeys a request, and answers it. Nobody is waited for here: a mission that is slow to end delays no emergency stop.
  """
  @spec obey(t(), request :: term(), {reference(), given_us :: integer()}) :: t()
  def obey(s, request, about)

  def obey(s, :stop, {ref, _given_us}) do
    halt(s, {EStop.Answer, :stood, [s.id, ref]})
    s
  end

  # The drive first says that its wheels are disarmed.
  def obey(s, :disarm, {ref, _given_us}) do
    halt(s, nil)
    stopped = {Pilot, :halt, [s.id, {EStop.Answer, :stood, [s.id, ref]}]}
    :ok = Device.disarm_later(Names.via(s.id, :drive), stopped)
    s
  end

  def obey(%{stop: %{latched?: true}} = s, :reset, about) do
    halt(s, {EStop.Answer, :release, [s.id, s.pressed, about]})
    s
  end

  # Whoever is not held drives on. A button of the gate's own may have been pressed since this was asked.
  def obey(s, :reset, {ref, given_us}) do
    if Board.latched?(s.board) do
      Nonblocking.answer(ref, {:error, "#{s.id} was stopped meanwhile; reset it again"})
      follow(s)
    else
      s = released(s, given_us)
      Nonblocking.answer(ref, :ok)
      s
    end
  end

  def obey(s, request, {ref, _given_us}) do
    {answer, s} = answer(request, s)
    Nonblocking.answer(ref, answer)
    s
  end

  defp answer(:estop, s) do
    s = press(s, EStop.State.press(s.stop))
    {EStop.Answer.stopped(s.id, s.board), s}
  end

  defp answer({:estop, call}, s) do
    s = called(s, call, 0)

    if s.stop.latched?,
      do: {EStop.Answer.stopped(s.id, s.board), s},
      else: {{:error, "#{s.id} was reset meanwhile"}, s}
  end

  defp answer(other, s),
    do:
      {{:error, "#{inspect(other, limit: 5)} does not stop #{s.id}; stop, disarm and estop do"},
       s}

  @doc "A call to stop was heard, from wherever."
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

  # Robots hear of a stop by their neighbours' heartbeats, too; but only a call says when it was made, which a robot
  # that is being reset at this moment must know.
  defp press(s, stop) do
    s = become(pressed(s), stop)
    call = Broadcaster.sound()
    write(%{s | stop: EStop.State.late(s.stop, call)})
  end

  @doc "The gate is free again, by a reset that was given then."
  @spec released(t(), given_us :: integer()) :: t()
  def released(s, given_us) do
    :ok = Gate.reset(s.id, tell: false)
    Broadcaster.quiet(s.stop.calls)
    become(%{s | reset_us: given_us}, EStop.State.reset(s.stop))
  end

  @doc "Whether who gave a reset then still waits for its answer."
  @spec waits?(given_us :: integer()) :: boolean()
  def waits?(given_us), do: now_us() - given_us < @release_us

  # The gate stands at once. The goal goes also where the pilot is stuck in its mission, and again
  # when the mission is out of command: it may have set another meanwhile.
  defp halt(%{id: id} = s, then) do
    # What was asked before this begins nothing after it (`Swarm.Commands.Freshness`, `Robot.Control.Pilot`).
    Board.put(s.board, :estop, :stopped, now_us(), Config.now(s.config))
    :ok = Gate.forget(id)
    :ok = Executive.stand(id)
    :ok = Pilot.halt(id, then)
  end

  # Made before a person reset this robot: somebody far away has only now been heard.
  defp over?(%{reset_us: nil}, _age_ms), do: false
  defp over?(%{reset_us: reset_us}, age_ms), do: 1_000 * age_ms > now_us() - reset_us

  defp now_us, do: System.monotonic_time(:microsecond)

  @doc "How the stop stands from now on: written down, carried out and spread, if it is another."
  @spec become(t(), EStop.State.t()) :: t()
  def become(%{stop: stop} = s, stop), do: s

  # Written down before the gate is told: an e-stop process that restarts in between knows that there is a
  # stop to carry out and to spread.
  def become(%{stop: before} = s, stop) do
    s = hold(write(%{s | stop: stop}))

    # The mission ends with it: after the reset nothing moves until somebody says so.
    if stop.latched? and not before.latched?, do: halt(s, nil)

    GenServer.cast(Names.via(s.id, :comms), :stop)
    s
  end

  @doc "Has the gate latched if the stop stands so, and it is not."
  @spec hold(t()) :: t()
  def hold(s) do
    if s.stop.latched? and not Board.latched?(s.board), do: :ok = Gate.estop(s.id, tell: false)
    s
  end

  @doc """
  A button of the gate's own has set or cleared its latch, which counts as it is now. It may have been set again
  although it was set: a reset that is being carried out was given before that.
  """
  @spec follow(t()) :: t()
  def follow(s) do
    latched? = Board.latched?(s.board)
    stop = EStop.State.follow(s.stop, latched?)
    if latched?, do: press(s, stop), else: become(s, stop)
  end

  @doc "Writes down how the stop stands."
  @spec write(t()) :: t()
  def write(s) do
    Board.put(s.board, :estop, :estop, s.stop, Config.now(s.config))
    s
  end
end
