defmodule Bridge.Hub do
  @moduledoc """
  Asks a fleet ten times a second for what clients asked for, and gives it to their writers that are ready (`Bridge.Broker`).
  Orders do not pass here, so nothing that hangs here delays one.

  What only a robot knows is asked for beside, one question after the other.
  """
  use GenServer
  alias Bridge.{Broker, Catalogue}
  alias Lab.Recording.Drawing
  alias Sim.Scene

  @tick_ms 100

  @typedoc "A topic with the number that is its own as long as the hub lives."
  @type channel :: %{id: pos_integer(), topic: Catalogue.topic()}

  @doc "Starts it for a fleet (`c:Console.Page.Service.feed/1`), with what is said of it (`Bridge.Catalogue`)."
  @spec start_link(%{
          module: module(),
          live: term(),
          robots: (... -> [atom()]),
          catalogue: module()
        }) :: GenServer.on_start()
  def start_link(source), do: GenServer.start_link(__MODULE__, source)

  @doc "That of a server of the page."
  @spec of(page :: pid()) :: pid()
  def of(page) do
    {__MODULE__, hub, _type, _modules} =
      page |> Supervisor.which_children() |> List.keyfind(__MODULE__, 0)

    hub
  end

  @doc """
  The calling process is a client; returns the fleet and the channels. Those that come later are said as `{:channels, [channel]}`,
  and messages as `{tag, {ns, payload}}`, to the process that asks for them (`next/2`).
  """
  @spec join(pid()) :: {{module(), live :: term()}, [channel()]}
  def join(hub), do: GenServer.call(hub, :join)

  @doc "A client asks for a topic, each `every_ms` at most; its messages bear the tag."
  @spec ask(pid(), client :: pid(), Broker.key(), Broker.tag(), non_neg_integer()) :: :ok
  def ask(hub, client, key, tag, every_ms \\ 0),
    do: GenServer.cast(hub, {:ask, client, key, tag, every_ms})

  @doc "A client wants no more of a topic."
  @spec drop(pid(), client :: pid(), Broker.key()) :: :ok
  def drop(hub, client, key), do: GenServer.cast(hub, {:drop, client, key})

  @doc "Asks for what waits for a client, which comes as `{:messages, [{tag, message}]}` to the caller when there is something."
  @spec next(pid(), client :: pid()) :: :ok
  def next(hub, client), do: GenServer.cast(hub, {:next, client, self()})

  @doc "Asks for the parameters, which come as `{:values, ref, %{name => value}}` to the caller."
  @spec values(pid(), ref :: term()) :: :ok
  def values(hub, ref), do: GenServer.cast(hub, {:values, ref, self()})

  @doc "Tells in the log what was ordered, and what came of it."
  @spec ordered(pid(), asker :: String.t(), line :: String.t(), Console.Orders.answer()) :: :ok
  def ordered(hub, asker, line, answer),
    do: GenServer.cast(hub, {:ordered, asker, line, answer})

  @impl GenServer
  def init(source) do
    s = Map.merge(source, %{broker: Broker.new([{:parameters, :changes}, {:channels, :events}])})

    {:ok,
     Map.merge(s, %{
       known: nil,
       channels: [],
       told: nil,
       paths: %{},
       ready: %{},
       asked: nil,
       values: [],
       ticking?: false
     })}
  end

  @impl GenServer
  def handle_call(:join, {client, _tag}, s) do
    _ref = Process.monitor(client)
    s = grow(s)
    broker = s.broker |> Broker.join(client) |> Broker.ask(client, :channels, :channels)
    {:reply, {{s.module, s.live}, s.channels}, tick(%{s | broker: broker})}
  end

  @impl GenServer
  def handle_cast({:ask, client, key, tag, every_ms}, s),
    do: {:noreply, serve(%{s | broker: Broker.ask(s.broker, client, key, tag, every_ms)})}

  def handle_cast({:drop, client, key}, s),
    do: {:noreply, %{s | broker: Broker.drop(s.broker, client, key)}}

  # One that has gone may still have asked.
  def handle_cast({:next, client, writer}, s) do
    if is_map_key(s.broker.clients, client),
      do: {:noreply, serve(%{s | ready: Map.put(s.ready, client, writer)})},
      else: {:noreply, s}
  end

  # All of a tick are answered by one scene.
  def handle_cast({:values, ref, asker}, s),
    do: {:noreply, %{s | values: [{ref, asker} | s.values]}}

  def handle_cast({:ordered, asker, line, answer}, s) do
    {:noreply, s |> log(&s.catalogue.order(&1, ns(), asker, line, answer)) |> serve()}
  end

  @impl GenServer
  def handle_info(:tick, %{broker: %{clients: clients}} = s) when clients == %{},
    do: {:noreply, %{s | ticking?: false}}

  def handle_info(:tick, s) do
    now_ms = Hal.Clock.now_ms()
    s = grow(s)
    {asking, shown} = s.broker |> Broker.due(now_ms) |> Enum.split_with(&s.catalogue.asks/1)

    logged? = Enum.any?(s.catalogue.log(), &Broker.asked?(s.broker, &1))
    wanted? = shown != [] or s.values != [] or logged?
    s = if wanted?, do: show(s, shown, now_ms), else: s

    {:noreply, s |> question(asking, now_ms) |> serve() |> Map.put(:ticking?, false) |> tick()}
  end

  # Said as of the tick that asked, else what is due at each tick would be at each other one.
  def handle_info({ref, abouts}, %{asked: {ref, asked_ms}} = s) do
    Process.demonitor(ref, [:flush])

    s =
      for {key, about} <- abouts, reduce: s do
        s -> say(s, key, s.catalogue.about(key, ns(), about), asked_ms)
      end

    {:noreply, serve(%{s | asked: nil})}
  end

  def handle_info({:DOWN, _ref, :process, client, _reason}, s) do
    broker = Broker.leave(s.broker, client)
    {:noreply, %{s | broker: broker, ready: Map.delete(s.ready, client)}}
  end

  defp tick(%{ticking?: true} = s), do: s

  defp tick(s) do
    _timer = Process.send_after(self(), :tick, @tick_ms)
    %{s | ticking?: true}
  end

  # Robots of a mesh come as they are heard.
  defp grow(s) do
    case s.robots.() do
      robots when robots == s.known ->
        s

      robots ->
        new = s.catalogue.list(robots) -- for(%{topic: topic} <- s.channels, do: topic)
        first = length(s.channels) + 1
        channels = for {topic, id} <- Enum.with_index(new, first), do: %{id: id, topic: topic}
        broker = Broker.add(s.broker, for(topic <- new, do: {topic.key, topic.pace}))
        s = %{s | known: robots, channels: s.channels ++ channels, broker: broker}
        say(s, :channels, channels, Hal.Clock.now_ms(), & &1)
    end
  end

  defp show(s, keys, now_ms) do
    scene = s.module.scene(s.live)
    at_ns = ns()
    for {ref, asker} <- Enum.reverse(s.values), do: send(asker, {:values, ref, parameters(scene)})
    s = %{s | values: [], paths: Drawing.note(s.paths, Catalogue.drawn(scene))}
    news = if s.told, do: Scene.news(scene.stages, s.told), else: []
    s = Enum.reduce(news, s, fn stage, s -> log(s, &s.catalogue.stage(&1, at_ns, stage)) end)

    Enum.reduce(keys, %{s | told: Scene.told(scene.stages)}, fn
      :parameters, s -> say(s, :parameters, parameters(scene), now_ms, & &1)
      key, s -> say(s, key, s.catalogue.scene(key, at_ns, scene, s.paths), now_ms)
    end)
  end

  defp log(s, words) do
    now_ms = Hal.Clock.now_ms()
    Enum.reduce(s.catalogue.log(), s, &say(&2, &1, words.(&1), now_ms))
  end

  defp say(s, key, message, now_ms, wrap \\ &{ns(), IO.iodata_to_binary(&1)}),
    do: %{s | broker: Broker.say(s.broker, key, message && wrap.(message), now_ms)}

  # The next question waits for the answer to this one.
  defp question(s, [], _now_ms), do: s
  defp question(%{asked: asked} = s, _keys, _now_ms) when asked != nil, do: s

  defp question(s, keys, now_ms) do
    {module, live, catalogue} = {s.module, s.live, s.catalogue}

    task =
      Task.async(fn ->
        for {robot, keys} <- Enum.group_by(keys, &catalogue.asks/1),
            about = module.about(live, robot),
            about != nil,
            key <- keys,
            do: {key, about}
      end)

    broker = Enum.reduce(keys, s.broker, &Broker.say(&2, &1, nil, now_ms))
    %{s | asked: {task.ref, now_ms}, broker: broker}
  end

  defp serve(s) do
    Enum.reduce(s.ready, s, fn {client, writer}, s ->
      if Broker.waiting?(s.broker, client) do
        {messages, broker} = Broker.take(s.broker, client)
        send(writer, {:messages, messages})
        %{s | broker: broker, ready: Map.delete(s.ready, client)}
      else
        s
      end
    end)
  end

  # What a person can set of the whole fleet, as far as it is known.
  defp parameters(%Scene{formation: {kind, spacing}}),
    do: %{"formation" => Atom.to_string(kind), "spacing" => spacing}

  defp parameters(_unknown), do: %{}

  defp ns, do: System.os_time(:nanosecond)
end
