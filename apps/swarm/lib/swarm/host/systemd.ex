defmodule Swarm.Host.Systemd do
  @moduledoc """
  Tells the machine's supervisor (systemd, by its protocol `sd_notify`) that the robot is up, its
  status, and, as long as that is true, that it is alive.

  The sign of life is sent only while the robot is well (`Swarm.Host.HealthCheck`): its gate and
  its executive did their work within the last second, and the drive's process handles its
  messages. It does not come from a timer that goes on beside a robot that hangs. What a
  supervisor in the VM can repair is repaired before systemd's time-out; what none can repair (a
  process that hangs, a VM that is frozen) ends in a new start of everything. The wheels have
  stopped long before, by the port program's last words.

  Options: `:socket`, the path that systemd gave, `@name` for an abstract one; `:robot`, the
  robot's id, `nil` for a node without one; `:period_ms`, how often it checks; `:pulse`, a
  function in place of `Swarm.Host.HealthCheck.of/1`.
  """
  use GenServer
  alias Hal.Ticker
  alias Swarm.Host.HealthCheck

  @period_ms 1_000

  @doc "Starts the process; `from_env/3` makes the options."
  @spec start_link(keyword()) :: GenServer.on_start()
  def start_link(options), do: GenServer.start_link(__MODULE__, options)

  @doc """
  The options for a robot, from what systemd has put into the environment of the process `os_pid`;
  `nil` if systemd does not want to be notified.

      iex> Swarm.Host.Systemd.from_env(%{"NOTIFY_SOCKET" => "/run/n", "WATCHDOG_USEC" => "2000000"}, :mag1, "7")
      [socket: "/run/n", robot: :mag1, period_ms: 500]
      iex> Swarm.Host.Systemd.from_env(%{}, :mag1, "7")
      nil
  """
  @spec from_env(Swarm.Host.ReleaseBoot.environment(), atom() | nil, os_pid :: String.t()) ::
          keyword() | nil
  def from_env(environment, robot, os_pid) do
    case Map.get(environment, "NOTIFY_SOCKET", "") do
      "" -> nil
      socket -> [socket: socket, robot: robot, period_ms: period(environment, os_pid)]
    end
  end

  @impl GenServer
  def init(options) do
    # Before everything else: a late sign of life counts as death.
    Process.flag(:priority, :high)
    {:ok, socket} = :gen_udp.open(0, [:local, active: false])

    period_ms = options[:period_ms] || @period_ms

    s = %{
      socket: socket,
      to: {:local, address(options[:socket])},
      robot: options[:robot],
      ticker: Ticker.start(:look, period_ms, period_ms),
      pulse: options[:pulse] || (&HealthCheck.of/1),
      ready?: false
    }

    {:ok, s, {:continue, :look}}
  end

  @impl GenServer
  def handle_continue(:look, s), do: {:noreply, look(s)}

  @impl GenServer
  def handle_info(:look, s), do: {:noreply, look(s)}

  defp look(s) do
    s = %{s | ticker: Ticker.next(s.ticker)}
    {well?, words} = if s.robot, do: s.pulse.(s.robot), else: {true, "a node without a robot"}
    tell(s, words, well?)
    %{s | ready?: s.ready? or well?}
  end

  # If the supervisor does not listen now, it will later, or it starts us again.
  defp tell(s, words, well?) do
    ready = if well? and not s.ready?, do: ["READY=1\n"], else: []
    alive = if well?, do: ["WATCHDOG=1\n"], else: []
    :gen_udp.send(s.socket, s.to, 0, [ready, alive, "STATUS=", one_line(words), "\n"])
  end

  defp one_line(words), do: String.replace(words, ~r/\s+/, " ")

  # Four checks within systemd's time-out, and at least one per second.
  defp period(environment, os_pid) do
    with ^os_pid <- Map.get(environment, "WATCHDOG_PID", os_pid),
         {usec, ""} when usec > 0 <- Integer.parse(Map.get(environment, "WATCHDOG_USEC", "")) do
      usec |> div(4_000) |> max(10) |> min(@period_ms)
    else
      _no_watchdog -> @period_ms
    end
  end

  defp address("@" <> name), do: <<0>> <> name
  defp address(path), do: path
end
