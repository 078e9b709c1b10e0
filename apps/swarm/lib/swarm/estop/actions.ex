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
  @release_ms 400

  @typedoc """
  `pressed` stands for the last time that somebody stopped it, `reset_ms` is when a person reset it last (monotonic).
  """
  @type t :: %{
          :config => Config.t(),
          :id => atom(),
          :board => Board.t(),
          :stop => EStop.State.t(),
          :pressed => reference(),
          :reset_ms => integer() | nil,
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
  @spec obey(t(), request :: term(), reference()) :: t()
  def obey(s, request, ref)

  def obey(s, :stop, ref) do
    halt(s, {EStop.Answer, :stood, [s.id, ref]})
    s
  end

  # The drive first says that its wheels are disarmed.
  def obey(s, :disarm, ref) do
    halt(s, nil)
    stopped = {Pilot, :halt, [s.id, {EStop.Answer, :stood, [s.id, ref]}]}
    :ok = Device.disarm_later(Names.via(s.id, :drive), stopped)
    s
  end

  def obey(%{stop: %{latched?: true}} = s, :reset, ref) do
    halt(s, {EStop.Answer, :release, [s.id, s.pressed, now() + @release_ms, ref]})
    s
  end

  # Whoever is not held drives on. A button of the gate's own may have been pressed since this was asked.
  def obey(s, :reset, ref) do
    if Board.latched?(s.board) do
      Nonblocking.answer(ref, {:error, "#{s.id} was stopped meanwhile; reset it again"})
      follow(s)
    else
      s = released(s)
      Nonblocking.answer(ref, :ok)
      s
    end
  end

  def obey(s, request, ref) do
    {answer, s} = answer(request, s)
    Nonblocking.answer(ref, answer)
    s
  end

  defp answer(:estop, s) do
    s = become(%{s | pressed: make_ref()}, EStop.State.press(s.stop))
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
        s = become(%{s | pressed: make_ref()}, stop)
        Broadcaster.pass_on(call, age_ms)
        s
      end
    else
      _malformed_or_heard_before -> s
    end
  end

  @doc "The gate is free again."
  @spec released(t()) :: t()
  def released(s) do
    :ok = Gate.reset(s.id)
    Broadcaster.quiet(s.stop.calls)
    become(%{s | reset_ms: now()}, EStop.State.reset(s.stop))
  end

  # The gate stands at once. The goal goes also where the pilot is stuck in its mission, and again
  # when the mission is out of command: it may have set another meanwhile.
  defp halt(%{id: id} = s, then) do
    # What was asked before this begins nothing after it (`Swarm.Commands.Freshness.local/3`, `Robot.Control.Pilot`).
    now = System.monotonic_time(:microsecond)
    Board.put(s.board, :estop, :stopped, now, Config.now(s.config))
    :ok = Gate.forget(id)
    :ok = Executive.stand(id)
    :ok = Pilot.halt(id, then)
  end

  # Made before a person reset this robot: somebody far away has only now been heard.
  defp over?(%{reset_ms: nil}, _age_ms), do: false
  defp over?(%{reset_ms: reset_ms}, age_ms), do: age_ms > now() - reset_ms

  defp now, do: System.monotonic_time(:millisecond)

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
    if s.stop.latched? and not Board.latched?(s.board), do: :ok = Gate.estop(s.id)
    s
  end

  @doc "The gate's latch is as it is: a button of its own may have set or cleared it."
  @spec follow(t()) :: t()
  def follow(s) do
    latched? = Board.latched?(s.board)
    # A reset that is being carried out was asked before this.
    s = if latched?, do: %{s | pressed: make_ref()}, else: s
    become(s, EStop.State.follow(s.stop, latched?))
  end

  @doc "Writes down how the stop stands."
  @spec write(t()) :: t()
  def write(s) do
    Board.put(s.board, :estop, :estop, s.stop, Config.now(s.config))
    s
  end
end
