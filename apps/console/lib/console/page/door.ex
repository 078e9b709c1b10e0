defmodule Console.Page.Door do
  @moduledoc """
  Lets connections in, each into a process of its own, in which mochiweb answers their requests (those of the page in
  `Console.Page.Request`), and ends those that stay no longer (`Console.Page.Connections`). mochiweb's own server would let in so
  many, of any origin, and none after them, and wait 300 s for a first request.
  """
  use GenServer
  # Debian's package; without it there is no page.
  @compile {:no_warn_undefined, [:mochiweb_clock, :mochiweb_http]}
  require Logger
  alias Console.Page
  alias Console.Page.{Connections, Guesses}

  @look_ms 250
  @acceptors 8
  @again_ms 100

  # How long a browser may take to read what was sent before its connection is closed.
  @send_timeout_ms 10_000

  # As mochiweb listens, whose longest line of a request is `recbuf`.
  @socket [
    :binary,
    reuseaddr: true,
    packet: :raw,
    backlog: 1_024,
    recbuf: 8_192,
    exit_on_close: false,
    active: false,
    nodelay: true,
    send_timeout: @send_timeout_ms,
    send_timeout_close: true
  ]

  @doc "Listens at `address` and `port`; `page` is handed to each request, which its module `answer` answers."
  @spec start_link(%{address: :inet.ip_address(), port: :inet.port_number(), page: map()}) ::
          GenServer.on_start()
  def start_link(options), do: GenServer.start_link(__MODULE__, options)

  @doc "The connection of the calling process has made a request that is answered, awaits the next, or lives."
  @spec note(pid(), Connections.state()) :: :ok
  def note(door, state), do: GenServer.cast(door, {:note, self(), state})

  @doc "The connection of the calling process says a token: is it right, or is it late, because too many were wrong?"
  @spec guess(pid(), token :: String.t()) :: :ok | :wrong | :late
  def guess(door, token), do: GenServer.call(door, {:guess, token})

  @impl GenServer
  def init(%{address: address, port: port, page: page}) do
    Process.flag(:trap_exit, true)
    _running = :mochiweb_clock.start()

    with {:ok, listen} <- :gen_tcp.listen(port, [{:ip, address} | @socket]) do
      page = Map.put(page, :door, self())

      s = %{
        listen: listen,
        page: page,
        acceptors: MapSet.new(),
        connections: %Connections{},
        guesses: %Guesses{},
        looking?: false
      }

      {:ok, Enum.reduce(1..@acceptors, s, fn _nth, s -> acceptor(s) end)}
    else
      {:error, reason} -> {:stop, reason}
    end
  end

  @impl GenServer
  def handle_call({:accepted, address}, {pid, _tag}, s) do
    s = acceptor(%{s | acceptors: MapSet.delete(s.acceptors, pid)})
    now_ms = Hal.Clock.now_ms()
    {:reply, :ok, s |> keep(Connections.add(s.connections, pid, address, now_ms)) |> look()}
  end

  def handle_call({:guess, token}, {pid, _tag}, s) do
    case Connections.address(s.connections, pid) do
      nil ->
        {:reply, :late, s}

      address ->
        right? = Page.Access.same?(token, s.page.token)
        {answer, untold, guesses} = Guesses.guess(s.guesses, address, right?, Hal.Clock.now_ms())
        if untold, do: tell(address, untold)
        {:reply, answer, %{s | guesses: guesses}}
    end
  end

  @impl GenServer
  def handle_cast({:note, pid, state}, s),
    do: {:noreply, keep(s, Connections.note(s.connections, pid, state, Hal.Clock.now_ms()))}

  @impl GenServer
  def handle_info(:look, s) do
    s = keep(%{s | looking?: false}, Connections.overdue(s.connections, Hal.Clock.now_ms()))
    {:noreply, if(s.connections.all == %{}, do: s, else: look(s))}
  end

  def handle_info({:EXIT, pid, reason}, s) do
    if pid == s.listen or MapSet.member?(s.acceptors, pid),
      do: {:stop, {:no_acceptor, reason}, s},
      else: {:noreply, %{s | connections: Connections.drop(s.connections, [pid])}}
  end

  defp keep(s, {connections, ended}) do
    for pid <- ended, do: Process.exit(pid, :kill)
    %{s | connections: connections}
  end

  defp look(%{looking?: true} = s), do: s

  defp look(s) do
    _timer = Process.send_after(self(), :look, @look_ms)
    %{s | looking?: true}
  end

  # What a log does must not keep the door waiting.
  defp tell(address, untold) do
    before = if untold == 0, do: "", else: " (#{untold} more since the last such line)"
    line = "the page was asked with a wrong token by #{:inet.ntoa(address)}#{before}"
    _pid = spawn(fn -> Logger.warning(line) end)
    :ok
  end

  defp acceptor(s) do
    pid = :proc_lib.spawn_link(__MODULE__, :accept, [self(), s.listen, s.page])
    %{s | acceptors: MapSet.put(s.acceptors, pid)}
  end

  @doc false
  @spec accept(pid(), :inet.socket(), map()) :: no_return()
  def accept(door, listen, page) do
    case :gen_tcp.accept(listen) do
      {:ok, socket} ->
        serve(door, socket, page)

      {:error, :closed} ->
        exit({:shutdown, :closed})

      # Such as no more files.
      {:error, _reason} ->
        receive(do: (:never -> :ok), after: (@again_ms -> accept(door, listen, page)))
    end
  end

  # One that has gone again has no address.
  defp serve(door, socket, page) do
    address =
      case :inet.peername(socket) do
        {:ok, {address, _port}} -> address
        {:error, _reason} -> {0, 0, 0, 0}
      end

    :ok = GenServer.call(door, {:accepted, address}, :infinity)
    :mochiweb_http.loop(socket, [], {page.answer, :answer, [page]})
  end
end
