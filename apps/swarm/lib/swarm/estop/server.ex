defmodule Swarm.EStop.Server do
  @moduledoc false
  # Runs the process of `Swarm.EStop`: receives messages, which `Swarm.EStop.Actions` carries out.
  use Hal.HardenedServer
  alias Robot.{Board, Names}
  alias Robot.Safety.Gate
  alias Swarm.EStop
  alias Mesh.Nonblocking
  alias Swarm.Directory
  alias Swarm.Order.Freshness
  alias Swarm.Wire.StopTags

  @impl GenServer
  def init(%Robot.Config{id: id} = config) do
    board = Board.find!(id)
    {stop, presses} = EStop.Actions.begin(board)

    s = %{
      config: config,
      id: id,
      board: board,
      stop: stop,
      life: System.system_time(:nanosecond),
      group: nil,
      name: nil,
      pressed: make_ref(),
      pressed_us: nil,
      presses: presses,
      sounded_us: nil,
      reset_us: nil
    }

    {:ok, s |> EStop.Actions.write() |> EStop.Actions.record(), {:continue, :enter}}
  end

  @impl GenServer
  def handle_continue(:enter, s) do
    # A stop that the previous e-stop process recorded may not have reached the gate; and a
    # direct stop of the gate since then has reached nobody.
    s = EStop.Actions.hold(s)

    followed? =
      Board.latched?(s.board) == EStop.State.held?(s.stop) and
        Gate.presses(s.board) == s.presses

    s = if followed?, do: s, else: EStop.Actions.follow(s)

    {:noreply,
     %{
       s
       | group: Directory.Membership.enter([:estops]),
         name: Directory.Membership.enter([{:estop, s.id}])
     }}
  end

  @impl GenServer
  def handle_cast({:beat, tags}, s),
    do: {:noreply, if(StopTags.tags?(tags), do: EStop.Actions.heard(s, tags), else: s)}

  # The latch as it is now, not when the gate reported it: this process may have set it again
  # since.
  def handle_cast(:latch, s), do: {:noreply, EStop.Actions.follow(s)}

  def handle_cast({:estop, call, age_ms}, s),
    do: {:noreply, EStop.Actions.called(s, call, age_ms)}

  def handle_cast({:command, request, ref}, s) when is_reference(ref),
    do: {:noreply, command(s, request, ref, nil)}

  def handle_cast({:command, request, ref, order}, s) when is_reference(ref),
    do: {:noreply, command(s, request, ref, order)}

  # From the robot's comms process, which has determined when it was given.
  def handle_cast({:in_time, request, ref, given_us}, s)
      when is_reference(ref) and is_integer(given_us) do
    now_us = System.monotonic_time(:microsecond)
    order = {:asked, given_us}
    judged = Freshness.judge(s.life, request, order, true, now_us, s.pressed_us)
    {:noreply, obey(s, request, ref, judged)}
  end

  # Nobody else knows this reference.
  def handle_cast({:release, pressed, ref, given_us}, %{pressed: pressed} = s)
      when is_reference(ref) and is_integer(given_us) do
    if EStop.Actions.waits?(given_us), do: EStop.Actions.release(s, {ref, given_us})
    {:noreply, s}
  end

  def handle_cast({:release, pressed, ref, _given_us}, s)
      when is_reference(pressed) and is_reference(ref) do
    EStop.Answer.stopped_again(s.id, ref)
    {:noreply, s}
  end

  def handle_cast({:unlatched, result, {pressed, {ref, given_us}} = about}, s)
      when is_reference(pressed) and is_reference(ref) and is_integer(given_us),
      do: {:noreply, EStop.Actions.released(s, result, about)}

  def handle_cast({:stamp, ref}, s) when is_reference(ref) do
    Nonblocking.answer(ref, Freshness.stamp(s.life, System.monotonic_time(:microsecond)))
    {:noreply, s}
  end

  def handle_cast({:present, true}, %{name: %{left?: true}} = s),
    do: {:noreply, %{s | name: Directory.Membership.enter([{:estop, s.id}])}}

  def handle_cast({:present, false}, s),
    do: {:noreply, %{s | name: Directory.Membership.leave(s.name)}}

  def handle_cast({:present, true}, s), do: {:noreply, s}

  @impl GenServer
  def handle_info({:unsaved, ref}, s) when is_reference(ref) do
    EStop.Answer.unsaved(s.id, s.board, ref)
    {:noreply, s}
  end

  def handle_info(message, s) do
    case {Directory.Membership.arrived(s.group, message),
          Directory.Membership.arrived(s.name, message)} do
      {{:ok, group}, :other} -> {:noreply, %{s | group: group}}
      {:other, {:ok, name}} -> {:noreply, %{s | name: name}}
      {:other, :other} -> {:noreply, s}
    end
  end

  defp command(s, request, ref, order) do
    now_us = System.monotonic_time(:microsecond)
    judged = Freshness.judge(s.life, request, order, node(ref) == node(), now_us, s.pressed_us)
    obey(s, request, ref, judged)
  end

  defp obey(s, request, ref, judged) do
    case judged do
      {:ok, given_us} ->
        EStop.Actions.obey(s, request, {ref, given_us})

      {:error, why} ->
        GenServer.cast(Names.via(s.id, :comms), {:rejected, :too_old})
        Nonblocking.answer(ref, Freshness.refusal(s.id, why))
        s
    end
  end
end
