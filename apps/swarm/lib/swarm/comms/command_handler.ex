defmodule Swarm.Comms.CommandHandler do
  @moduledoc """
  Answers the commands of people (`Swarm`): it accepts or refuses each, in one line. It runs in the
  robot's comms process, which people on any node find by the directory. `Swarm.EStop` handles what stops a
  robot, and the reset.

  | request | answer |
  |---|---|
  | `:status` | `Swarm.Status` |
  | `:ping` | `{:ok, line}`: who it is, since when, in what state (`Swarm.Comms.PingReply`) |
  | `:start`, `{:start, options}` | the group mission begins; anew where there are options |
  | `{:formation, kind, spacing}` | for the running mission |
  | a `Robot.Command` | for this robot alone, which leaves the group's mission for it |
  | `:arm`, `:acknowledge` | of the wheels (`Hal.Device`): done, or why not |

  While the emergency stop holds a robot, it refuses all that would move it, and to be armed. What would
  move it is also refused, with the reason, while its drive is offline or not armed (`Robot.Safety.Readiness`): else
  the motion would begin later, when somebody arms it.
  """
  alias Hal.Device
  alias Robot.{Board, Config, Names}
  alias Robot.Control.Pilot
  alias Robot.Safety.{LivenessMonitor, Readiness}
  alias Robot.Mission.Manual
  alias Swarm.{Missions, Status}
  alias Swarm.Commands.Order
  alias Swarm.Comms.{PingReply, Receiver}

  @typedoc "`:accepted`: the pilot has the order; it is `:ok` once the executive has it, too."
  @type answer :: :ok | :accepted | {:ok, String.t()} | {:error, String.t()} | Status.t()

  @doc "Answers a request."
  @spec answer(term(), Config.t(), Board.t(), Receiver.t()) :: answer()
  def answer(:status, config, board, receiver), do: Status.of(config, board, receiver)

  def answer(:ping, config, board, receiver),
    do: {:ok, PingReply.line(config, board, Status.of(config, board, receiver))}

  def answer(:acknowledge, %{id: id}, _board, _ear),
    do: named(Device.acknowledge(Names.via(id, :drive)), id)

  # What is asked for while all stand would otherwise begin with the reset.
  def answer(request, config, board, receiver) do
    if Board.latched?(board),
      do: {:error, "#{config.id} is held by the emergency stop; reset it first"},
      else: free(request, config, board, receiver)
  end

  defp free(:arm, %{id: id}, _board, _ear), do: named(Device.arm(Names.via(id, :drive)), id)

  defp free(request, config, board, receiver) do
    with {:ok, request} <- checked(request, config),
         :ok <- well(config, board),
         :ok <- ready(request, config, board),
         :ok <- obey(request, doing(board), config, receiver),
         do: :accepted
  end

  @doc "What a robot says to a formation that it has no mission for."
  @spec shapeless(atom()) :: {:error, line :: String.t()}
  def shapeless(id), do: {:error, "#{id} is on no mission that has a formation; start it first"}

  defp named(:ok, _id), do: :ok
  defp named({:error, line}, id), do: {:error, "#{id}: #{line}"}

  # People come by `Swarm`, which has checked it all; but anybody may send something here.
  defp checked({:start, options}, config) do
    with {:ok, {:start, options}} <- Order.check({:start, options}),
         {:ok, {module, _defaults}} <- mission(config),
         {:ok, options} <- Missions.options(module, options, nil),
         do: {:ok, {:start, options}}
  end

  defp checked(request, _config), do: Order.check(request)

  # A pilot that hangs would not answer, and the comms process would wait for it and be silent to others. A gate that hangs
  # is ended, and with it what was begun.
  defp well(%{id: id}, board) do
    hangs =
      for part <- [:gate, :pilot],
          {:ok, {:silent, module}, _at_ms} <- [Board.fetch(board, {:hung, part}, :infinity)],
          do: LivenessMonitor.words(part, module)

    case hangs do
      [] -> :ok
      [where | _] -> {:error, "#{id} hangs in #{where}; it is started again by itself"}
    end
  end

  # A shape moves nobody who is on no mission, and whoever is on one is ready.
  defp ready({:formation, _kind, _spacing}, _config, _board), do: :ok

  defp ready(_request, config, board) do
    with {:error, line} <- Readiness.of(config, board), do: {:error, "#{config.id}: #{line}"}
  end

  defp doing(board) do
    case Board.fetch(board, :mission, :infinity) do
      {:ok, %{state: {Manual, phase}}, _} -> {:alone, phase}
      {:ok, %{state: {_module, phase}}, _} -> {:group, phase}
      _idle -> :idle
    end
  end

  defp obey(:start, doing, config, receiver), do: obey({:start, []}, doing, config, receiver)

  # A mission that the board still shows may have been stopped just now. What people had asked of it
  # outlives that.
  defp obey({:start, []}, doing, config, _ear) do
    with {:error, :idle} <- again(doing, config),
         {:error, :idle} <- Pilot.resume(config.id),
         do: begin([], config)
  end

  defp obey({:start, options}, _doing, config, _ear), do: begin(options, config)

  defp obey({:formation, _kind, _spacing} = command, {:group, _phase}, config, _ear) do
    with {:error, :idle} <- Pilot.command(config.id, command), do: shapeless(config.id)
  end

  defp obey({:formation, _kind, _spacing}, _doing, config, _ear), do: shapeless(config.id)

  defp obey({:follow_the_leader, leader} = command, doing, %{id: id} = config, receiver) do
    with :ok <- Order.follow(id, leader, Receiver.leaders(receiver, Config.now(config))),
         do: alone(command, doing, config)
  end

  defp obey({:find_blob, colour} = command, doing, config, _ear) do
    with :ok <- known(colour, config), do: alone(command, doing, config)
  end

  defp obey(command, doing, config, _ear), do: alone(command, doing, config)

  defp known(_colour, %{camera: nil, id: id}), do: {:error, "#{id} has no camera to look with"}
  defp known(nil, _config), do: :ok

  defp known(colour, %{id: id, colours: %{classes: classes}}) do
    names = Enum.map(classes, & &1.name)

    if colour in names,
      do: :ok,
      else: {:error, "#{id} knows no colour #{inspect(colour)}; it looks for #{list(names)}"}
  end

  defp list([name]), do: name
  defp list(names), do: Enum.join(names, ", ")

  defp begin(options, config) do
    with {:ok, {module, defaults}} <- mission(config) do
      :ok = Pilot.start(config.id, module, Keyword.merge(defaults, options))
      Pilot.command(config.id, :start)
    end
  end

  defp mission(%{mission: nil}),
    do: with({:ok, module} <- Missions.default(), do: {:ok, {module, []}})

  defp mission(%{mission: mission}), do: {:ok, mission}

  defp again({:group, _phase}, config), do: Pilot.command(config.id, :start)
  defp again(_idle_or_alone, _config), do: {:error, :idle}

  defp alone(command, {:alone, _phase}, config) do
    with {:error, :idle} <- Pilot.command(config.id, command), do: alone(command, :idle, config)
  end

  defp alone(command, _idle_or_group, config) do
    :ok = Pilot.start(config.id, Manual, [])
    Pilot.command(config.id, command)
  end
end
