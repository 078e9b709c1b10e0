defmodule Hal.RFlex.Speeds do
  @moduledoc false
  # Sends speeds to the wheels for a driver: the requested speed, limited (`Hal.Drive.SlewLimiter`), repeated, and after a
  # release of the brake. Pure; time is passed in, in milliseconds.
  alias Hal.Drive.SlewLimiter
  alias Hal.RFlex.{Commands, Driver, Schedule}
  alias Hal.RFlex.Protocol.{Command, Queue}
  alias Hal.Twist

  @repeat_ms 100

  @doc "How often a speed is repeated, in milliseconds."
  @spec repeat_ms() :: pos_integer()
  def repeat_ms, do: @repeat_ms

  @doc "Sets the requested speed; a value that is not a speed counts as a stop, and is counted."
  @spec want(Driver.t(), Twist.t() | term()) :: Driver.t()
  def want(s, twist) do
    case SlewLimiter.check(twist) do
      :ok -> %{s | wanted: twist}
      {:error, _line} -> %{s | wanted: Twist.zero(), refused: s.refused + 1}
    end
  end

  @doc "Queues the speed for now, if it has changed or is due again."
  @spec say(Driver.t(), integer()) :: Driver.t()
  def say(s, at_ms), do: s |> step(at_ms) |> changed(at_ms)

  # Computes the speed for now.
  defp step(s, at_ms) do
    s = if at_ms - s.stepped_ms >= pause_ms(s), do: stood(s), else: s
    wanted = if known?(s), do: s.wanted, else: Twist.zero()
    {_twist, ramp} = SlewLimiter.step(s.ramp, wanted, (at_ms - s.stepped_ms) / 1000)
    %{s | ramp: ramp, stepped_ms: at_ms}
  end

  # After a pause of this length the line has sent its last words, and whatever this sends, it does not.
  defp pause_ms(s), do: s.options.serial[:keep_alive_ms] || 200

  defp stood(s), do: %{s | ramp: SlewLimiter.standing(s.ramp), said: nil, released?: false}

  defp known?(%{options: %{conversions: conversions}}),
    do: conversions.distance != nil and conversions.angle != nil

  defp changed(%{ramp: %{twist: twist}, said: twist} = s, at_ms) do
    if Schedule.due?(s, :speed, at_ms), do: say_speed(s, at_ms), else: s
  end

  defp changed(s, at_ms), do: say_speed(s, at_ms)

  defp say_speed(%{ramp: %{twist: twist}} = s, at_ms) do
    queue =
      if Twist.zero?(twist) do
        Queue.stop(s.queue, Commands.stop(s.options))
      else
        before = s.said || Twist.zero()
        Enum.reduce(Commands.speed(s.options, twist, before), release(s), &put/2)
      end

    Schedule.again(
      %{s | queue: queue, said: twist, released?: not Twist.zero?(twist) or s.released?},
      :speed,
      at_ms,
      @repeat_ms
    )
  end

  defp release(%{released?: true, senses: %{brake: brake}} = s) when brake != true, do: s.queue
  defp release(s), do: Queue.put(s.queue, :brake, Command.release())

  defp put({key, bytes}, queue), do: Queue.put(queue, key, bytes)
end
