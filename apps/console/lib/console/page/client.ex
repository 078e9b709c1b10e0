defmodule Console.Page.Client do
  @moduledoc false
  # Tells the page of the robot that a person looks at there, five times a second, and of the messages between robots or of the
  # nodes, where these are looked at. A node that does not answer delays nothing else.
  use GenServer
  alias Console.Page.{Feed, State}
  alias Console.About

  @about_ms 200
  @history_ms 500
  @watched %{messages: 500, nodes: 1_000}

  @doc """
  Starts it for the connection of the caller, and linked to it: without one of them the other is of no use, and the page
  connects again. `reply` writes text to the browser.
  """
  @spec start_link(pid(), (String.t() -> term())) :: {:ok, pid()}
  def start_link(feed, reply), do: GenServer.start_link(__MODULE__, {self(), feed, reply})

  @doc "The robot that is looked at; `nil` for none."
  @spec look(pid(), atom() | nil) :: :ok
  def look(client, robot), do: GenServer.cast(client, {:look, robot})

  @doc "Whether the messages between robots, or the nodes, are looked at."
  @spec watch(pid(), :messages | :nodes, boolean()) :: :ok
  def watch(client, what, on?), do: GenServer.cast(client, {:watch, what, on?})

  @impl GenServer
  def init({connection, feed, reply}) do
    ref = Process.monitor(connection)
    {module, live} = Feed.source(feed)
    if function_exported?(module, :history, 2), do: send(self(), :history)

    {:ok,
     %{
       connection: ref,
       feed: feed,
       module: module,
       live: live,
       reply: reply,
       looked: nil,
       told: nil,
       watched: %{}
     }}
  end

  @impl GenServer
  def handle_cast({:look, robot}, s) do
    if robot && s.looked == nil, do: send(self(), :about)
    {:noreply, %{s | looked: robot}}
  end

  # One question at a time, however often a page asks.
  def handle_cast({:watch, what, on?}, s) do
    case s.watched do
      %{^what => {:asked, ref, _on?, _told}} ->
        {:noreply, put_in(s.watched[what], {:asked, ref, on?, nil})}

      _not_asked when on? ->
        {:noreply, ask(s, what, nil)}

      _not_asked ->
        {:noreply, %{s | watched: Map.delete(s.watched, what)}}
    end
  end

  defp ask(s, what, told) do
    {module, live} = {s.module, s.live}
    %Task{ref: ref} = Task.async(fn -> {what, apply(module, what, [live])} end)
    put_in(s.watched[what], {:asked, ref, true, told})
  end

  # Only what differs from what was told last.
  @impl GenServer
  def handle_info({ref, {what, now}}, s) when is_reference(ref) do
    Process.demonitor(ref, [:flush])

    case s.watched do
      %{^what => {:asked, ^ref, true, told}} ->
        if now != told, do: s.reply.(State.watched(what, now))
        _timer = Process.send_after(self(), {:ask, what, ref}, @watched[what])
        {:noreply, put_in(s.watched[what], {:told, ref, now})}

      %{^what => {:asked, ^ref, false, _told}} ->
        {:noreply, %{s | watched: Map.delete(s.watched, what)}}
    end
  end

  def handle_info({:ask, what, ref}, s) do
    case s.watched do
      %{^what => {:told, ^ref, told}} -> {:noreply, ask(s, what, told)}
      _asked_no_more_or_anew -> {:noreply, s}
    end
  end

  def handle_info(:about, %{looked: nil} = s), do: {:noreply, s}

  def handle_info(:about, s) do
    with %{} = about <- s.module.about(s.live, s.looked) do
      about = Map.put(about, :events, Feed.events(s.feed, s.looked))
      s.reply.(About.json(s.looked, about))
    end

    _timer = Process.send_after(self(), :about, @about_ms)
    {:noreply, s}
  end

  # Only what is new.
  def handle_info(:history, s) do
    history = s.module.history(s.live, if(s.told, do: s.told.count, else: 0))
    news = %{history | entries: []}
    if news != s.told, do: s.reply.(State.history(history))
    _timer = Process.send_after(self(), :history, @history_ms)
    {:noreply, %{s | told: news}}
  end

  # A connection that ends as it should takes no linked process along.
  def handle_info({:DOWN, ref, :process, _pid, _reason}, %{connection: ref} = s),
    do: {:stop, :normal, s}
end
