defmodule Robot.Devices.Log do
  @moduledoc """
  Writes a robot's log: a line when a device goes offline, with the reason in words, and when it
  is back, when it refuses what it is told, when armed wheels are disarmed for a reason, when a bumper stays pressed, when the
  gate, a behaviour or a mission hangs, when pictures cannot be saved or nothing can be recorded, when the emergency stop
  would not survive a restart of the machine, when another robot has the same name, when one
  is not believed because its numbers are impossible, when it refuses to drive by its own joystick, when it obeys an order of a person, and when the mission is replaced. The events report changes, so retries of a device are not logged.
  """
  require Logger
  alias Hal.Event
  alias Robot.Safety.LivenessMonitor

  @events [
    [:hal, :device, :online],
    [:hal, :device, :offline],
    [:hal, :device, :arming],
    [:hal, :device, :refusal],
    [:hal, :device, :odd],
    [:robot, :fault],
    [:robot, :stage],
    [:robot, :role, :dropped],
    [:robot, :gate, :absent],
    [:robot, :estop_file, :error],
    [:robot, :estop_file, :healed],
    [:robot, :departure_file, :failed],
    [:robot, :executive, :away],
    [:vision, :saver, :failed],
    [:vision, :saver, :healed],
    [:robot, :recorder, :failed],
    [:robot, :recorder, :healed],
    [:robot, :incident, :kept],
    [:robot, :incident, :failed],
    [:swarm, :comms, :duplicate_id],
    [:swarm, :comms, :unique_id],
    [:swarm, :comms, :joystick],
    [:swarm, :comms, :ordered]
  ]

  @doc "Attaches the log to its events, once on a node."
  @spec attach() :: :ok
  def attach do
    for event <- events() do
      _ = Event.attach({__MODULE__, event}, event, &__MODULE__.write/4, nil)
    end

    :ok
  end

  @doc "The events that may be logged."
  @spec events() :: [Event.name()]
  def events do
    @events ++
      for part <- LivenessMonitor.parts(),
          what <- [:silent, :hung, :again],
          do: [:robot, part, what]
  end

  @doc false
  @spec write(Event.name(), map(), map(), term()) :: :ok
  def write(event, measurements, about, _config) do
    about = Map.merge(measurements, about)
    with {level, line} <- event |> List.last() |> line(about), do: Logger.log(level, line)
    :ok
  end

  @doc """
  The level and the line for an event; `nil` if it is not logged.

      iex> about = %{robot: :mag1, device: :drive, line: "/dev/ttyR0: no such device"}
      iex> Robot.Devices.Log.line(:offline, about)
      {:warning, "mag1: drive offline: /dev/ttyR0: no such device"}
      iex> Robot.Devices.Log.line(:online, %{robot: :mag1, device: :drive, again?: true})
      {:info, "mag1: drive online again"}
      iex> Robot.Devices.Log.line(:refusal, %{robot: :mag1, device: :ptz, request: :look, line: "not now", count: 4})
      {:warning, "mag1: ptz refuses to look: not now (4 so far)"}
      iex> Robot.Devices.Log.line(:silent, %{robot: :mag1, line: "its mission Patrol"})
      {:warning, "mag1 hangs in its mission Patrol"}
      iex> Robot.Devices.Log.line(:stage, %{stage: :given_up, robot: :mag1, x: 2.0, y: 1.0, blocked_by: "mag2"})
      {:warning, "mag1 gives up its way to 2.0,1.0: blocked by mag2"}
  """
  @spec line(atom(), map()) :: {Logger.level(), String.t()} | nil
  def line(:absent, %{robot: robot, seconds: seconds}),
    do:
      {:warning,
       "#{robot}: emergency stop, because no page, pad or bin/presence has been heard for #{seconds} s"}

  def line(:offline, %{line: line} = about), do: {:warning, "#{name(about)} offline: #{line}"}

  def line(:online, %{again?: true} = about), do: {:info, "#{name(about)} online again"}
  def line(:online, about), do: {:debug, "#{name(about)} online"}

  def line(:refusal, %{request: request, line: line, count: count} = about),
    do: {:warning, "#{name(about)} refuses to #{request}: #{line} (#{count} so far)"}

  def line(:odd, %{line: line} = about), do: {:warning, "#{name(about)}: #{line}"}

  def line(:arming, %{state: {:error, _reason}, line: line} = about) do
    {:error,
     "#{name(about)}: LINE LOST while the wheels turned (#{line}); it stands until a person has looked " <>
       "and acknowledges"}
  end

  def line(:arming, %{state: :disarmed, was: :armed, why: why} = about) when why != nil,
    do: {:warning, "#{name(about)} disarmed: #{why}"}

  def line(:arming, _changed_by_a_person), do: nil
  def line(:fault, %{robot: robot, line: nil}), do: {:info, "#{robot}: the fault is over"}
  def line(:fault, %{robot: robot, line: line}), do: {:warning, "#{robot} stands: #{line}"}

  def line(:silent, about), do: {:warning, "#{about.robot} hangs in #{about.line}"}
  def line(:again, about), do: {:info, "#{about.robot} no longer hangs in #{about.line}"}

  def line(:hung, about),
    do: {:error, "#{about.robot} hung in #{about.line} for 2 s: started again, idle"}

  def line(:error, %{robot: robot, file: file, reason: reason}) do
    {:error,
     "#{robot}: the e-stop file #{file} is not as the stop is (#{:file.format_error(reason)}): the stop holds as " <>
       "it was told, but would not outlive a restart of the machine so; the file is tried again"}
  end

  def line(:dropped, %{robot: robot, role: role, count: count}) do
    {:warning,
     "#{robot}: its #{role} was sent what it does not know; so far it has dropped #{count} messages"}
  end

  def line(:kept, %{file: file, why: why}),
    do: {:info, "the last minute is in #{file}: #{Enum.join(why, "; ")}"}

  def line(:failed, %{line: line, why: why}),
    do: {:warning, "the last minute could not be kept (#{Enum.join(why, "; ")}): #{line}"}

  def line(:failed, %{robots: [robot | _], line: line}),
    do: {:warning, "#{robot}: nothing can be recorded: #{line}"}

  def line(:failed, %{robot: robot, file: file}) do
    {:error,
     "#{robot}: cannot write to #{file} that it has left its start pose: if it crashes on its way, it will believe " <>
       "to stand there"}
  end

  def line(:away, %{robot: robot}) do
    {:warning,
     "#{robot} started again after it had left its start pose, and does not know where it is until it sees others; " <>
       "or stop it, put it at its start pose, and start it"}
  end

  def line(:failed, %{line: line}), do: {:warning, line}

  def line(:healed, %{robots: [robot | _], file: file}),
    do: {:info, "#{robot}: recorded again, in #{file}"}

  def line(:healed, %{robot: robot, file: file}),
    do: {:info, "#{robot}: the e-stop file #{file} is as the stop is"}

  def line(:healed, %{folder: folder}), do: {:info, "pictures are saved in #{folder} again"}

  def line(:ordered, %{robot: robot, order: order, by: giver}),
    do: {:info, "#{robot}: #{order}, by #{giver}"}

  def line(:joystick, %{line: line}), do: {:warning, "#{line} (its joystick says move)"}

  def line(:duplicate_id, %{robot: robot, other: other}) do
    {:error,
     "#{robot}: a robot of this name was on #{other} before; this one stands, is silent and takes no orders"}
  end

  def line(:unique_id, %{robot: robot}) do
    {:warning,
     "#{robot}: no other robot of this name has been heard for 10 s; this one speaks and takes orders again"}
  end

  def line(:stage, %{stage: :refused, robot: robot, from: from, epoch: epoch, allowed: allowed}) do
    {:warning,
     "#{robot}: #{from} says epoch #{epoch}, which no leadership can have reached; at most #{allowed} is " <>
       "allowed now; #{from} is left out of the mission"}
  end

  def line(:stage, %{stage: :given_up, robot: robot, x: x, y: y, blocked_by: why}),
    do: {:warning, "#{robot} gives up its way to #{x},#{y}: blocked by #{why}"}

  def line(:stage, %{stage: :replacement, what: what, robot: robot, says: says}),
    do: {if(what == :back, do: :warning, else: :info), "#{robot} #{says}"}

  def line(:stage, %{stage: :crashed, robot: robot, crash: crash}),
    do: {:error, "#{robot} crashed, and is idle: #{crash}"}

  def line(:stage, _told_by_others), do: nil

  defp name(%{robot: robot, device: device}), do: "#{robot}: #{device}"
  defp name(%{device: device}), do: "#{device}"
end
