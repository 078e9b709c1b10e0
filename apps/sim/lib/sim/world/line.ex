defmodule Sim.World.Line do
  @moduledoc """
  Joins a robot to the world of another process of the operating system by a socket of the file system, which no cut of a
  network touches: bodies are in the world whatever the radios do.

  To the robot's simulated devices its end is the world's server: they find it in `Sim.World.Directory`, send it what
  `Sim.World.Server` gets, and see it end when the world ends. At the world's end a process of its own stands in for each of
  them, which ends with the device.
  """
  alias Sim.World

  @again_ms 200
  @options [:binary, packet: 4, active: false]

  @doc "The world's end at `path`, as a child: lines of the robots of the world of this name on this node."
  @spec world(Path.t(), name :: term()) :: Supervisor.child_spec()
  def world(path, name), do: task(:accept, [path, name])

  @doc "A robot's end, as a child: connects to the world at `path`, again and again, and is a world of this name here."
  @spec robot(Path.t(), name :: term()) :: Supervisor.child_spec()
  def robot(path, name), do: task(:keep, [path, name])

  defp task(function, arguments),
    do: %{id: __MODULE__, start: {Task, :start_link, [__MODULE__, function, arguments]}}

  @doc false
  @spec accept(Path.t(), term()) :: no_return()
  def accept(path, name) do
    _ = File.rm(path)
    {:ok, listener} = :gen_tcp.listen(0, [{:ifaddr, {:local, path}} | @options])
    again(listener, name)
  end

  defp again(listener, name) do
    {:ok, socket} = :gen_tcp.accept(listener)

    monitor =
      hand(socket, fn ->
        server = World.Directory.find(name)
        Process.monitor(server)
        serve(socket, server, %{})
      end)

    Process.demonitor(monitor, [:flush])
    again(listener, name)
  end

  # A robot that is frozen reads nothing: then this process waits, and no other. `stands` are by device.
  defp serve(socket, server, stands) do
    receive do
      {:tcp, ^socket, bytes} ->
        serve(socket, server, carry_out(:erlang.binary_to_term(bytes), server, stands))

      {:say, device, what} ->
        tell(socket, {device, what})
        serve(socket, server, stands)

      _closed_or_ended ->
        exit(:closed)
    end
  end

  defp carry_out({:gone, device}, _server, stands) do
    with %{^device => stand} <- stands, do: send(stand, :end)
    Map.delete(stands, device)
  end

  defp carry_out({how, robot, kind, device}, server, stands) when how in [:attach, :detach] do
    line = self()
    stands = Map.put_new_lazy(stands, device, fn -> spawn_link(fn -> stand(line, device) end) end)
    GenServer.cast(server, {how, robot, kind, stands[device]})
    stands
  end

  defp carry_out(request, server, stands) do
    GenServer.cast(server, request)
    stands
  end

  defp stand(line, device) do
    receive do
      {:world, _server, what} ->
        send(line, {:say, device, what})
        stand(line, device)

      :end ->
        :ok
    end
  end

  @doc false
  @spec keep(Path.t(), term()) :: no_return()
  def keep(path, name) do
    with {:ok, socket} <- :gen_tcp.connect({:local, path}, 0, @options) do
      monitor =
        hand(socket, fn ->
          :ok = World.Directory.enter(name, self())
          relay(socket)
        end)

      receive do: ({:DOWN, ^monitor, :process, _pid, _ended} -> :ok)
    end

    receive do
    after
      @again_ms -> keep(path, name)
    end
  end

  defp relay(socket) do
    receive do
      {:tcp, ^socket, bytes} ->
        {device, what} = :erlang.binary_to_term(bytes)
        send(device, {:world, self(), what})

      {:"$gen_cast", request} ->
        with {:attach, _robot, _kind, device} <- request, do: Process.monitor(device)
        tell(socket, request)

      {:DOWN, _monitor, :process, device, _reason} ->
        tell(socket, {:gone, device})

      {:tcp_closed, ^socket} ->
        exit(:no_world)

      _unknown ->
        :ok
    end

    relay(socket)
  end

  # A process of its own has the socket; its monitor.
  defp hand(socket, serve) do
    {pid, monitor} =
      spawn_monitor(fn ->
        receive do: (:yours -> :ok)
        with :ok <- :inet.setopts(socket, active: true), do: serve.()
      end)

    _ = :gen_tcp.controlling_process(socket, pid)
    send(pid, :yours)
    monitor
  end

  # A world, or robot, that has ended is told of by the socket.
  defp tell(socket, term), do: _ = :gen_tcp.send(socket, :erlang.term_to_binary(term))
end
