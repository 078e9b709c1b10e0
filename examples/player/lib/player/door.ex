defmodule Player.Door do
  @moduledoc """
  Listens for the clients of each robot at a port of its own, and lets each into a process of its own (`Player.Connection`). It says
  which client drives a robot: the one that drove it last, until it has said nothing for half a second; the others are refused
  meanwhile.
  """
  use GenServer
  require Logger
  alias Hal.Clock
  alias Player.Connection

  # Robots of a mesh come as they are heard.
  @look_ms 1_000
  @most_clients 64
  # As long as a word of driving lasts.
  @hold_ms 500
  @socket [
    :binary,
    reuseaddr: true,
    packet: :raw,
    backlog: 64,
    active: false,
    nodelay: true,
    keepalive: true,
    send_timeout: 10_000,
    send_timeout_close: true
  ]

  @doc "Listens at `address`, from `port` on."
  @spec start_link(%{address: :inet.ip4_address(), port: :inet.port_number(), page: map()}) ::
          GenServer.on_start()
  def start_link(options), do: GenServer.start_link(__MODULE__, options)

  @doc """
  The port of each robot: those that have one keep it, and the others follow in the order of their names.

      iex> Player.Door.ports(%{}, [:mag10, :mag2, :min1], 6665)
      %{mag2: 6665, mag10: 6666, min1: 6667}
      iex> Player.Door.ports(%{min1: 6665}, [:mag1, :min1], 6665)
      %{min1: 6665, mag1: 6666}
  """
  @spec ports(%{atom() => :inet.port_number()}, [atom()], :inet.port_number()) ::
          %{atom() => :inet.port_number()}
  def ports(known, robots, first) do
    (robots -- Map.keys(known))
    |> Enum.sort_by(&order("#{&1}"))
    |> Enum.with_index(first + map_size(known))
    |> Enum.filter(fn {_robot, port} -> port < 65_536 end)
    |> Map.new()
    |> Map.merge(known)
  end

  # mag2 before mag10.
  defp order(name) do
    [_all, kind, number] = Regex.run(~r/\A(.*?)(\d*)\z/s, name)
    {kind, String.length(number), number}
  end

  @impl GenServer
  def init(%{address: address, port: port, page: page}) do
    Process.flag(:trap_exit, true)

    s = %{
      address: address,
      first: port,
      page: page,
      ports: %{},
      listens: %{},
      acceptors: %{},
      clients: %{},
      drives: %{}
    }

    {:ok, look(s)}
  end

  @impl GenServer
  def handle_call({:accepted, robot}, {pid, _tag}, s) do
    s = acceptor(%{s | acceptors: Map.delete(s.acceptors, pid)}, robot)
    here = Enum.count(s.clients, fn {_pid, of} -> of == robot end)

    if here < @most_clients,
      do: {:reply, :ok, put_in(s.clients[pid], robot)},
      else: {:reply, :full, s}
  end

  def handle_call({:claim, robot, who}, {pid, _tag}, s) do
    now_ms = Clock.now_ms()

    case s.drives do
      %{^robot => {other, by, until_ms}} when other != pid and now_ms < until_ms ->
        {:reply, {:error, by}, s}

      _free ->
        {:reply, :ok, put_in(s.drives[robot], {pid, who, now_ms + @hold_ms})}
    end
  end

  @impl GenServer
  def handle_info(:look, s), do: {:noreply, look(s)}

  def handle_info({:EXIT, pid, reason}, s) do
    cond do
      is_map_key(s.clients, pid) ->
        free = :maps.filter(fn _robot, {by, _who, _until_ms} -> by != pid end, s.drives)
        {:noreply, %{s | clients: Map.delete(s.clients, pid), drives: free}}

      is_map_key(s.acceptors, pid) ->
        {:stop, {:no_acceptor, reason}, s}

      # One that was refused, because there were too many.
      is_pid(pid) ->
        {:noreply, s}

      true ->
        {:stop, {:no_socket, reason}, s}
    end
  end

  defp look(s) do
    _timer = Process.send_after(self(), :look, @look_ms)
    ports = ports(s.ports, s.page.robots.(), s.first)

    ports
    |> Map.drop(Map.keys(s.ports))
    |> Enum.sort_by(&elem(&1, 1))
    |> Enum.reduce(%{s | ports: ports}, fn {robot, port}, s -> listen(s, robot, port) end)
  end

  # A port that is taken is told once; the other robots have theirs.
  defp listen(s, robot, port) do
    case :gen_tcp.listen(port, [{:ip, s.address} | @socket]) do
      {:ok, listen} ->
        Logger.info("player: #{robot} at #{:inet.ntoa(s.address)}:#{port}")
        acceptor(put_in(s.listens[robot], listen), robot)

      {:error, reason} ->
        where = "#{:inet.ntoa(s.address)}:#{port}"

        Logger.warning(
          "player: #{robot} is not served at #{where}: #{:inet.format_error(reason)}"
        )

        s
    end
  end

  defp acceptor(s, robot) do
    door = self()
    claim = &GenServer.call(door, {:claim, robot, &1})
    at = %{robot: robot, listen: s.listens[robot], door: door, page: s.page, claim: claim}
    pid = :proc_lib.spawn_link(__MODULE__, :accept, [at])
    put_in(s.acceptors[pid], robot)
  end

  @doc false
  @spec accept(map()) :: no_return()
  def accept(at) do
    case :gen_tcp.accept(at.listen) do
      {:ok, socket} ->
        if GenServer.call(at.door, {:accepted, at.robot}, :infinity) == :ok,
          do: Connection.run(socket, at),
          else: :gen_tcp.close(socket)

      {:error, :closed} ->
        exit({:shutdown, :closed})

      # Such as no more files.
      {:error, _reason} ->
        receive(do: (:never -> :ok), after: (100 -> accept(at)))
    end
  end
end
