defmodule Robot.Safety.DryRun do
  @moduledoc false
  # Lets a robot run without moving: with `dry_run: true` in `Robot.Config` it perceives, decides and communicates
  # as usual, but commands for the wheels and the camera's head are printed instead of sent. A person can compare them
  # with what they expect before the wheels may turn.
  #
  # The gate keeps commanding the wheels to stand, and their device, which owns the hardware, never
  # arms (`Hal.Device.Arming`). The events are `[:robot, :dry_run]`; the log prints them.
  require Logger
  alias Hal.{Event, Twist}

  @event [:robot, :dry_run]

  @type command :: {:drive, Twist.t(), limits :: [atom()]} | {:look, pan :: float()}

  @doc "Attaches the log to the events: once on a node, however often this is called."
  @spec attach() :: :ok
  def attach do
    _once = Event.attach(__MODULE__, @event, &__MODULE__.write/4, nil)
    :ok
  end

  @doc """
  The effects (`Robot.Role`) that report what a robot would do now, none if the line equals `before`, the last one
  reported; and the line.
  """
  @spec tell(atom(), command(), before :: String.t() | nil) ::
          {[Robot.Role.effect()], String.t()}
  def tell(robot, command, before) do
    case line(robot, command) do
      ^before -> {[], before}
      line -> {[{:event, @event, %{command: command, line: line}}], line}
    end
  end

  @doc false
  @spec write(Event.name(), map(), map(), term()) :: :ok
  def write(@event, _measurements, %{line: line}, _config), do: Logger.info(line)

  @doc """
  The line for a command, rounded to hundredths of metres and whole degrees.

      iex> Robot.Safety.DryRun.line(:mag1, {:drive, Hal.Twist.new(0.3, -0.5), [:near]})
      "dry run: mag1 would drive at 0.30 m/s and turn by -29 deg/s (limited: near)"
      iex> Robot.Safety.DryRun.line(:mag1, {:drive, Hal.Twist.new(0.001, 0), [:dead_man]})
      "dry run: mag1 would stand (limited: dead_man)"
      iex> Robot.Safety.DryRun.line(:mag1, {:look, 0.5})
      "dry run: mag1 would look 29 deg to the left"
  """
  @spec line(atom(), command()) :: String.t()
  def line(robot, {:drive, %Twist{linear: linear, turn: turn}, limits}) do
    centimetres = round(linear * 100)
    degrees = degrees(turn)

    what =
      cond do
        {centimetres, degrees} == {0, 0} -> "stand"
        degrees == 0 -> "drive at #{speed(centimetres)}"
        centimetres == 0 -> "turn by #{degrees} deg/s"
        true -> "drive at #{speed(centimetres)} and turn by #{degrees} deg/s"
      end

    "dry run: #{robot} would #{what}#{limited(limits)}"
  end

  def line(robot, {:look, pan}) do
    side = if pan < 0, do: "right", else: "left"
    "dry run: #{robot} would look #{abs(degrees(pan))} deg to the #{side}"
  end

  defp speed(centimetres),
    do: "#{:erlang.float_to_binary(centimetres / 100, decimals: 2)} m/s"

  defp degrees(radians), do: round(radians * 180 / :math.pi())

  defp limited([]), do: ""
  defp limited(limits), do: " (limited: #{limits |> Enum.uniq() |> Enum.join(", ")})"
end
