defmodule Sim.Emulator.RFlexController do
  @moduledoc """
  Emulates the controller of a Magellan Pro or an ATRV mini at the other end of the serial line, written from the fact
  sheet alone. Pure: bytes and time in, bytes and the wheels' speed out; `Sim.Emulator` runs it on a pseudo-terminal
  with a body in a simulated world. Its options are those of `Sim.Emulator.RFlexController.Options`.

  It reports nothing unless it was asked to, and silently skips errors on the line. The text
  `:phrase`, anywhere on the line, switches it off until it is switched on again.
  """
  @behaviour Sim.Emulator.Core
  alias Hal.{Odometry, Twist}
  import Sim.Emulator.RFlexController.State, only: [count: 3, stamp: 2, tell: 2]
  alias Sim.Emulator.RFlexController
  alias Sim.Emulator.RFlexController.{CommandHandler, Frame, Motors, Options, Senses, Sonars}

  # How often a command to the body is repeated.
  @repeat_ms 100
  # The most bytes that may wait unread; more is noise.
  @most_waiting 64

  @type t :: RFlexController.State.t()

  @impl Sim.Emulator.Core
  def new(options, at_ms) do
    with {:ok, options} <- Options.check(options),
         do: {:ok, RFlexController.State.boot(options, at_ms)}
  end

  @doc "Switched off and on: as at the start, except that the body stays where it is."
  @impl Sim.Emulator.Core
  def restart(%RFlexController.State{} = core, at_ms) do
    %{
      RFlexController.State.boot(core.options, at_ms)
      | centivolts: core.centivolts,
        ranges: core.ranges,
        near: core.near
    }
  end

  @impl Sim.Emulator.Core
  def hear(%RFlexController.State{off?: true} = core, _bytes, _at_ms), do: core
  def hear(%RFlexController.State{} = core, <<>>, _at_ms), do: core

  def hear(%RFlexController.State{} = core, bytes, at_ms) do
    core = listen(core, bytes)

    if core.off? do
      %{core | motors: Motors.brake(core.motors, true, at_ms), buffer: <<>>, out: []}
    else
      {frames, rest, bad} = Frame.cut(core.buffer <> bytes)
      take(core, frames, rest, bad, at_ms)
    end
  end

  defp listen(%{options: %{phrase: nil}} = core, _bytes), do: core

  defp listen(%{options: %{phrase: phrase}} = core, bytes) do
    text = core.tail <> bytes
    kept = min(byte_size(text), byte_size(phrase) - 1)

    %{
      core
      | off?: :binary.match(text, phrase) != :nomatch,
        tail: binary_part(text, byte_size(text), -kept)
    }
  end

  defp take(core, frames, rest, bad, at_ms) do
    core = core |> count(:frames, length(frames)) |> count(:bad, bad)
    core = %{core | buffer: rest, buffer_ms: if(rest != <<>>, do: at_ms)}
    Enum.reduce(frames, core, &receive_order(&2, &1, at_ms))
  end

  defp receive_order(%{options: %{pace: :off}} = core, frame, at_ms),
    do: CommandHandler.obey(core, frame, at_ms)

  # A small buffer: what arrives when it is full is lost.
  defp receive_order(%{options: %{pace: {_ms, room}}} = core, frame, at_ms) do
    if :queue.len(core.waiting) < min(room, @most_waiting) do
      %{
        core
        | waiting: :queue.in(frame, core.waiting),
          next_order_ms: core.next_order_ms || at_ms
      }
    else
      count(core, :lost, 1)
    end
  end

  @impl Sim.Emulator.Core
  def feel(%RFlexController.State{} = core, {:odometry, %Odometry{} = odometry}, at_ms) do
    core = %{core | motors: core.motors |> Motors.advance(at_ms) |> Motors.roll(odometry)}
    home(core, at_ms)
  end

  def feel(%RFlexController.State{} = core, {:sonar, ranges}, _at_ms),
    do: %{core | ranges: ranges}

  def feel(%RFlexController.State{} = core, {:ir, ranges}, _at_ms), do: %{core | near: ranges}

  def feel(%RFlexController.State{} = core, {:power, volts}, _at_ms),
    do: %{core | centivolts: max(round(100 * (volts - core.options.power_offset)), 0)}

  def feel(%RFlexController.State{} = core, {:bumpers, pressed}, at_ms) do
    inputs = Senses.inputs(pressed, core.options)
    changed = for {address, state} <- inputs, core.inputs[address] != state, do: {address, state}
    tell_inputs(%{core | inputs: inputs}, Enum.sort(changed), at_ms)
  end

  def feel(%RFlexController.State{} = core, _other, _at_ms), do: core

  @doc "Holds the joystick there: its counts and the bits of its buttons."
  @spec stick(t(), integer(), integer(), byte()) :: t()
  def stick(%RFlexController.State{} = core, x, y, buttons), do: %{core | stick: {x, y, buttons}}

  defp home(%{options: %{home: nil}} = core, _at_ms), do: core

  defp home(%{options: %{home: {address, from, to}}} = core, at_ms) do
    {_way, turn} = core.motors.gone
    round = 2 * :math.pi()
    closed? = modulo(turn - from, round) <= modulo(to - from, round)

    if closed? == core.home?,
      do: core,
      else: tell_inputs(%{core | home?: closed?}, [{address, if(closed?, do: 1, else: 0)}], at_ms)
  end

  defp modulo(angle, round), do: angle - round * Float.floor(angle / round)

  defp tell_inputs(%{inputs_wanted: nil} = core, _states, _at_ms), do: core

  defp tell_inputs(core, states, at_ms) do
    Enum.reduce(states, core, fn {address, state}, core ->
      tell(core, RFlexController.Report.input(stamp(core, at_ms), address, state))
    end)
  end

  @impl Sim.Emulator.Core
  def run(%RFlexController.State{off?: true} = core, at_ms), do: wish(%{core | at_ms: at_ms}, [])

  def run(%RFlexController.State{} = core, at_ms) do
    core =
      %{core | at_ms: at_ms}
      |> give_up(at_ms)
      |> work_off(at_ms)
      |> Map.update!(:motors, &Motors.advance(&1, at_ms))
      |> report_motion(at_ms)
      |> report_inputs(at_ms)
      |> report_sonars(at_ms)
      |> report_infrared(at_ms)

    wish(%{core | out: []}, Enum.reverse(core.out))
  end

  @impl Sim.Emulator.Core
  def wheels(%RFlexController.State{off?: true}, _at_ms), do: Twist.zero()

  def wheels(%RFlexController.State{} = core, at_ms),
    do: core.motors |> Motors.advance(at_ms) |> Motors.wanted()

  defp give_up(%{buffer_ms: since_ms, options: %{give_up_ms: wait_ms}} = core, at_ms)
       when since_ms != nil and at_ms - since_ms >= wait_ms do
    {frames, rest, bad} = Frame.give_up(core.buffer)
    take(core, frames, rest, bad, at_ms)
  end

  defp give_up(core, _at_ms), do: core

  defp work_off(%{next_order_ms: due_ms} = core, at_ms) when due_ms != nil and due_ms <= at_ms do
    {ms, _room} = core.options.pace

    case :queue.out(core.waiting) do
      {{:value, frame}, waiting} ->
        %{core | waiting: waiting, next_order_ms: due_ms + ms}
        |> CommandHandler.obey(frame, at_ms)
        |> work_off(at_ms)

      {:empty, _waiting} ->
        %{core | next_order_ms: nil}
    end
  end

  defp work_off(core, _at_ms), do: core

  defp report_motion(core, at_ms) do
    periodic(core, :motion, at_ms, fn core, mask ->
      for axis <- [0, 1], Bitwise.band(mask, Bitwise.bsl(1, axis)) != 0, reduce: core do
        core ->
          counts = Motors.counts(core.motors, axis)
          told = Motors.told(core.motors, axis)
          tell(core, RFlexController.Report.motor(stamp(core, at_ms), axis, counts, told))
      end
    end)
  end

  defp report_inputs(core, at_ms) do
    periodic(core, :inputs_wanted, at_ms, fn core, _nothing ->
      tell_inputs(core, Enum.sort(core.inputs), at_ms)
    end)
  end

  defp report_infrared(core, at_ms) do
    periodic(core, :infrared, at_ms, fn
      %{near: []} = core, _nothing ->
        core

      core, _nothing ->
        tell(core, RFlexController.Report.infrared(stamp(core, at_ms), boards(core)))
    end)
  end

  defp boards(core), do: Senses.infrared(core.near, core.options)

  defp report_sonars(%{sonars: nil} = core, _at_ms), do: core

  defp report_sonars(core, at_ms) do
    {told, sonars} = Sonars.run(core.sonars, core.ranges, core.options, at_ms * 1000)

    Enum.reduce(told, %{core | sonars: sonars}, fn echoes, core ->
      tell(core, RFlexController.Report.sonar(stamp(core, at_ms), echoes))
    end)
  end

  # After a delay it does not make up for the reports it missed.
  defp periodic(core, what, at_ms, report) do
    case Map.fetch!(core, what) do
      {due_ms, period_ms, argument} when due_ms <= at_ms ->
        next_ms = if due_ms + period_ms > at_ms, do: due_ms + period_ms, else: at_ms + period_ms
        core |> Map.put(what, {next_ms, period_ms, argument}) |> report.(argument)

      _later_or_never ->
        core
    end
  end

  defp wish(core, bytes) do
    wanted = if core.off?, do: Twist.zero(), else: Motors.wanted(core.motors)

    case core.wished do
      {^wanted, since_ms} when core.at_ms - since_ms < @repeat_ms -> {bytes, [], core}
      _other_or_long_ago -> {bytes, [{:drive, wanted}], %{core | wished: {wanted, core.at_ms}}}
    end
  end

  @impl Sim.Emulator.Core
  def next_ms(%RFlexController.State{off?: true}), do: nil

  def next_ms(%RFlexController.State{} = core) do
    periods =
      for {due_ms, _period, _} <- [core.motion, core.inputs_wanted, core.infrared], do: due_ms

    [
      core.buffer_ms && core.buffer_ms + core.options.give_up_ms,
      core.next_order_ms,
      Motors.end_ms(core.motors),
      core.sonars && div(core.sonars.next_us + 999, 1000)
      | periods
    ]
    |> Enum.reject(&is_nil/1)
    |> Enum.min(fn -> nil end)
  end
end
