defmodule Hal.RFlex.Commands do
  @moduledoc false
  # Sequences of commands that a driver sends together: speeds, stops, initialisation and last
  # words. Pure.
  alias Hal.Twist
  alias Hal.RFlex.Options
  alias Hal.RFlex.Protocol.{Command, Queue}

  # For a base whose conversion is not known. It stands, and should brake whatever its units are.
  @some_acceleration 100_000

  @type commands :: [{Queue.key(), binary()}]

  @doc """
  A speed; `before` is the last one. Axis 0 uses the acceleration if it gets faster, and the
  braking otherwise.
  """
  @spec speed(Options.t(), Twist.t(), Twist.t()) :: commands()
  def speed(%Options{} = options, %Twist{} = twist, %Twist{} = before) do
    %{conversions: %{distance: distance, angle: angle}, limits: limits} = options

    rate =
      if abs(twist.linear) > abs(before.linear),
        do: limits.max_acceleration,
        else: limits.max_braking

    move = Command.move(trunc(twist.linear * distance), acceleration(distance, rate))
    turn = Command.turn(trunc(twist.turn * angle), trunc(limits.max_turn * angle))
    [{{:speed, 0}, move}, {{:speed, 1}, turn}]
  end

  @doc "A stop of both axes; axis 0 brakes with `max_braking`."
  @spec stop(Options.t()) :: commands()
  def stop(%Options{limits: limits} = options) do
    braking = acceleration(options.conversions.distance, limits.max_braking)
    [{{:speed, 0}, Command.move(0, braking)}, {{:speed, 1}, Command.turn(0)}]
  end

  @doc "The commands that set up a controller, at the opening or after a silence."
  @spec first_words(Options.t()) :: commands()
  def first_words(%Options{conversions: conversions, limits: limits} = options) do
    move = acceleration(conversions.distance, limits.max_acceleration)
    turn = acceleration(conversions.angle, limits.max_turn_acceleration)

    [
      reports: Command.system_reports(options.report_period, 3),
      inputs: Command.input_reports(options.report_period),
      defaults: Command.defaults()
    ] ++
      [{{:prepare, 0}, Command.prepare(0, move)}, {{:prepare, 1}, Command.prepare(1, turn)}] ++
      if(sonar?(options), do: [sonar: sonar_on(options)], else: []) ++
      if(infrared?(options), do: [infrared: Command.infrared_on()], else: [])
  end

  @doc """
  The line's last words when nothing can drive any more: they stop both axes and set the brake.
  All of it is sent twice, because nothing will notice the loss of a frame.
  """
  @spec last_words(Options.t()) :: binary()
  def last_words(%Options{} = options) do
    stop = for {_key, bytes} <- stop(options), into: <<>>, do: bytes
    :binary.copy(stop <> Command.brake(), 2)
  end

  @doc "The last words of a driver that ends in order: they end the controller's reports too."
  @spec farewell(Options.t()) :: binary()
  def farewell(%Options{} = options) do
    last_words(options) <>
      if(sonar?(options), do: Command.sonar_off(), else: <<>>) <>
      if(infrared?(options), do: Command.infrared_off(), else: <<>>) <>
      Command.system_reports(0, 0) <> Command.input_reports(0)
  end

  @doc "Which range sensors are read, by the options."
  @spec senses(Options.t()) :: [:sonar | :infrared]
  def senses(%Options{} = options) do
    for {sense, true} <- [sonar: sonar?(options), infrared: infrared?(options)], do: sense
  end

  defp sonar?(options), do: Enum.sum(options.sonar_banks) > 0

  # Infrareds are of no use without their law; a robot can drive without them.
  defp infrared?(%{conversions: conversions} = options) do
    Enum.sum(options.ir_banks) > 0 and (conversions.ir_a != nil or conversions.ir_b != nil)
  end

  defp sonar_on(%{sonar_times: {echo, ping, set}}), do: Command.sonar_on(echo, ping, set)

  defp acceleration(nil, _rate), do: @some_acceleration
  # Never 0: a base that should stop, but with no braking at all, would roll on.
  defp acceleration(units, rate), do: max(trunc(units * rate), 2)
end
