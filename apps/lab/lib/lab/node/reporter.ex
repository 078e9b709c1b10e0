defmodule Lab.Node.Reporter do
  @moduledoc false
  # Reports the state of its part to a fleet's launcher, ten times a second, and each stage of a
  # robot of this node. If the launcher cannot be reached at once, the report is dropped: the next
  # one is newer.
  #
  # It sends messages `{Lab.Node.Reporter, name, what}`, where `what` is `{:report, term}` or `{:stage, about}`. If there
  # is a file instead of a launcher, the newest report is in it, `{at_us, term}` by the machine's time, whole or not at all.
  use GenServer
  alias Hal.{Event, Ticker}

  @period_ms 100

  @doc "Starts the reporter; `report` is `{m, f, a}`, called for each report."
  @spec start_link({pid(), name :: atom()} | Path.t(), {module(), atom(), list()}) ::
          GenServer.on_start()
  def start_link(launcher, report), do: GenServer.start_link(__MODULE__, {launcher, report})

  # Sent once, and again until the launcher can be reached.
  @doc false
  @spec stage(Event.name(), map(), map(), pid()) :: :ok
  def stage(_event, _measurements, about, reporter),
    do: GenServer.cast(reporter, {:tell, {:stage, about}})

  @impl GenServer
  def init({launcher, report}) do
    :ok = Event.attach(__MODULE__, [:robot, :stage], &__MODULE__.stage/4, self())
    ticker = Ticker.start(:report, @period_ms, @period_ms)
    {:ok, %{launcher: launcher, report: report, waiting: [], ticker: ticker}}
  end

  @impl GenServer
  def handle_cast({:tell, what}, s), do: {:noreply, deliver(%{s | waiting: s.waiting ++ [what]})}

  @impl GenServer
  def handle_info(:report, %{report: {m, f, a}} = s) do
    s = deliver(s)
    if s.waiting == [], do: post(s, {:report, apply(m, f, a)})
    {:noreply, schedule(s)}
  end

  # In order: a stage before the one that follows it.
  defp deliver(%{waiting: []} = s), do: s

  defp deliver(%{waiting: [first | rest]} = s) do
    case post(s, first) do
      :ok -> deliver(%{s | waiting: rest})
      # A run has a dozen stages; if more than this wait, the launcher is gone.
      _not_now -> %{s | waiting: Enum.take(s.waiting, -100)}
    end
  end

  defp post(%{launcher: path}, {:report, term}) when is_binary(path) do
    File.write!(path <> ".new", :erlang.term_to_binary({:os.perf_counter(:microsecond), term}))
    File.rename!(path <> ".new", path)
  end

  defp post(%{launcher: path}, _stage) when is_binary(path), do: :ok

  defp post(%{launcher: {launcher, name}}, what) do
    if node(launcher) in Node.list(),
      do: :erlang.send(launcher, {__MODULE__, name, what}, [:nosuspend, :noconnect]),
      else: :noconnect
  end

  defp schedule(s), do: %{s | ticker: Ticker.next(s.ticker)}
end
