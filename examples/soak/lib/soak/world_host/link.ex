defmodule Soak.WorldHost.Link do
  @moduledoc """
  Holds a robot's end of its line to the world, which runs in a process of the operating system of its own
  (`Soak.WorldHost`). The line is a socket of the file system, so no cut of the network touches it: bodies are in
  the world whatever the radios do.

  To the robot's simulated devices this process is the world's server: they find it in
  `Sim.World.Directory`, send it what `Sim.World.Server` gets, and see it end when the world ends.
  """
  alias Sim.World

  @again_ms 200

  @doc "The specification of a child that connects to the world at `path`, again and again, for `robot`."
  @spec child_spec({name :: term(), Path.t(), robot :: atom()}) :: Supervisor.child_spec()
  def child_spec(arguments),
    do: %{id: __MODULE__, start: {Task, :start_link, [__MODULE__, :keep, [arguments]]}}

  @doc false
  @spec keep({term(), Path.t(), atom()}) :: no_return()
  def keep({_name, path, _robot} = arguments) do
    with {:ok, socket} <- :gen_tcp.connect({:local, path}, 0, [:binary, packet: 4, active: false]) do
      {pid, monitor} = spawn_monitor(__MODULE__, :line, [socket, arguments])
      :ok = :gen_tcp.controlling_process(socket, pid)
      send(pid, :yours)
      receive do: ({:DOWN, ^monitor, :process, ^pid, _ended} -> :ok)
    end

    receive do
    after
      @again_ms -> keep(arguments)
    end
  end

  @doc false
  @spec line(:gen_tcp.socket(), {term(), Path.t(), atom()}) :: :ok
  def line(socket, {name, _path, robot}) do
    receive do: (:yours -> :ok)
    :ok = :inet.setopts(socket, active: true)
    :ok = World.Directory.enter(name, self())
    relay(socket, robot, %{})
  end

  # `devices` is who is attached, by kind.
  defp relay(socket, robot, devices) do
    receive do
      {:tcp, ^socket, bytes} ->
        {kind, what} = :erlang.binary_to_term(bytes)
        with %{^kind => pid} <- devices, do: send(pid, {:world, self(), what})
        relay(socket, robot, devices)

      {:"$gen_cast", {:attach, ^robot, kind, pid}} ->
        Process.monitor(pid)
        tell(socket, {:attach, kind})
        relay(socket, robot, Map.put(devices, kind, pid))

      {:"$gen_cast", {:detach, ^robot, kind, pid}} ->
        relay(socket, robot, detach(socket, devices, {kind, pid}))

      {:"$gen_cast", request} ->
        tell(socket, {:request, request})
        relay(socket, robot, devices)

      {:DOWN, _monitor, :process, pid, _reason} ->
        gone = for {kind, ^pid} <- devices, do: {kind, pid}
        relay(socket, robot, Enum.reduce(gone, devices, &detach(socket, &2, &1)))

      {:tcp_closed, ^socket} ->
        :ok

      {:tcp_error, ^socket, _reason} ->
        :ok

      _unknown ->
        relay(socket, robot, devices)
    end
  end

  # Another process may have attached meanwhile.
  defp detach(socket, devices, {kind, pid}) do
    case devices do
      %{^kind => ^pid} ->
        tell(socket, {:detach, kind})
        Map.delete(devices, kind)

      _another ->
        devices
    end
  end

  # A world that has ended is told of by the socket.
  defp tell(socket, term), do: _ = :gen_tcp.send(socket, :erlang.term_to_binary(term))
end
