defmodule Console.Page.Feed do
  @moduledoc false
  # Asks for the scene ten times a second while a browser shows it, and gives it as JSON to the pushers that are ready.
  #
  # A pusher that is still writing gets the newest scene when it asks again, so that a slow browser sees fewer of them, and
  # nothing queues.
  use GenServer
  alias Console.Page.{Changes, State}

  @period_ms 100

  @doc false
  @spec start_link(%{module: module(), live: term()}) :: GenServer.on_start()
  def start_link(source), do: GenServer.start_link(__MODULE__, source)

  @doc "The feed of a page."
  @spec of(page :: pid()) :: pid()
  def of(page) do
    {__MODULE__, feed, _type, _modules} =
      page |> Supervisor.which_children() |> List.keyfind(__MODULE__, 0)

    feed
  end

  @doc "The map, as JSON: what does not change."
  @spec map(pid()) :: String.t()
  def map(feed), do: GenServer.call(feed, :map)

  @doc "The receiver of commands: the module and the fleet (`Console.Live`)."
  @spec source(pid()) :: {module(), term()}
  def source(feed), do: GenServer.call(feed, :source)

  @doc "What happened to a robot while the page was shown, and what the fleet tells of it: lines, the last the newest."
  @spec events(pid(), atom()) :: [String.t()]
  def events(feed, robot), do: GenServer.call(feed, {:events, robot})

  @doc "Asks for the next scene, which comes as `{:scene, json}`."
  @spec next(pid()) :: :ok
  def next(feed), do: GenServer.cast(feed, {:next, self()})

  @impl GenServer
  def init(%{module: module, live: live}) do
    {:ok,
     %{
       module: module,
       live: live,
       map: nil,
       scene: nil,
       changes: %Changes{},
       waiting: [],
       ticking?: false
     }}
  end

  @impl GenServer
  def handle_call(:map, _from, %{map: nil} = s) do
    map =
      State.map(
        s.module.scene(s.live),
        s.module.offers(s.live),
        {Swarm.MissionRegistry.names(), Swarm.MissionRegistry.messages()},
        beside(s)
      )

    {:reply, map, %{s | map: map}}
  end

  def handle_call(:map, _from, s), do: {:reply, s.map, s}
  def handle_call(:source, _from, s), do: {:reply, {s.module, s.live}, s}

  def handle_call({:events, _robot}, _from, %{scene: nil} = s), do: {:reply, [], s}

  def handle_call({:events, robot}, _from, s),
    do: {:reply, Changes.of(s.changes, s.scene, robot), s}

  @impl GenServer
  def handle_cast({:next, pusher}, s), do: {:noreply, tick(%{s | waiting: [pusher | s.waiting]})}

  @impl GenServer
  def handle_info(:tick, %{waiting: []} = s), do: {:noreply, %{s | ticking?: false}}

  def handle_info(:tick, s) do
    scene = s.module.scene(s.live)
    {pace, notice} = {s.module.pace(s.live), s.module.notice(s.live)}
    json = State.scene(scene, pace, notice, Hal.Clock.now_ms(), beside(s))
    for pusher <- s.waiting, do: send(pusher, {:scene, json})
    s = %{s | scene: scene, changes: Changes.note(s.changes, scene)}
    {:noreply, tick(%{s | waiting: [], ticking?: false})}
  end

  defp beside(s), do: if(function_exported?(s.module, :beside, 1), do: s.module.beside(s.live))

  defp tick(%{ticking?: true} = s), do: s

  defp tick(s) do
    _timer = Process.send_after(self(), :tick, @period_ms)
    %{s | ticking?: true}
  end
end
