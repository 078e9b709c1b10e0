defmodule Soak.WorldHost.Line do
  @moduledoc """
  Holds the world's end of a robot's line to it, over a socket of the file system; the robot's end is
  `Soak.WorldHost.Link`. It stands in for the robot's devices: it attaches processes of its own to the world's
  server, which end with it.
  """
  alias Sim.World

  @doc "Listens at `path` for a robot, again and again."
  @spec start_link(Path.t(), atom()) :: {:ok, pid()}
  def start_link(path, robot), do: Task.start_link(__MODULE__, :accept, [path, robot])

  @doc false
  @spec accept(Path.t(), atom()) :: no_return()
  def accept(path, robot) do
    _ = File.rm(path)
    options = [:binary, packet: 4, active: false, ifaddr: {:local, path}]
    {:ok, listener} = :gen_tcp.listen(0, options)
    again(listener, robot)
  end

  defp again(listener, robot) do
    {:ok, socket} = :gen_tcp.accept(listener)
    line = spawn(__MODULE__, :line, [socket, robot])
    :ok = :gen_tcp.controlling_process(socket, line)
    send(line, :yours)
    again(listener, robot)
  end

  @doc false
  @spec line(:gen_tcp.socket(), atom()) :: :ok
  def line(socket, robot) do
    receive do: (:yours -> :ok)
    :ok = :inet.setopts(socket, active: true)
    relay(socket, World.Directory.find(:soak), robot, %{})
  end

  # A robot that is frozen reads nothing: then this process waits, and no other.
  defp relay(socket, server, robot, stands) do
    receive do
      {:tcp, ^socket, bytes} ->
        relay(
          socket,
          server,
          robot,
          carry_out(:erlang.binary_to_term(bytes), server, robot, stands)
        )

      {:say, kind, what} ->
        _ = :gen_tcp.send(socket, :erlang.term_to_binary({kind, what}))
        relay(socket, server, robot, stands)

      {:tcp_closed, ^socket} ->
        exit(:closed)

      {:tcp_error, ^socket, _reason} ->
        exit(:closed)
    end
  end

  defp carry_out({:attach, kind}, server, robot, stands) do
    stands = drop(stands, kind)
    line = self()
    stand = spawn_link(fn -> stand(line, kind) end)
    GenServer.cast(server, {:attach, robot, kind, stand})
    Map.put(stands, kind, stand)
  end

  defp carry_out({:detach, kind}, _server, _robot, stands), do: drop(stands, kind)

  defp carry_out({:request, request}, server, _robot, stands) do
    GenServer.cast(server, request)
    stands
  end

  # The server sees it end.
  defp drop(stands, kind) do
    {stand, stands} = Map.pop(stands, kind)
    if stand, do: send(stand, :end)
    stands
  end

  defp stand(line, kind) do
    receive do
      {:world, _server, what} ->
        send(line, {:say, kind, what})
        stand(line, kind)

      :end ->
        :ok
    end
  end
end
