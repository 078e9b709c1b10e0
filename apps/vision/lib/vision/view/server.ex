defmodule Vision.View.Server do
  @moduledoc false
  # Runs the process of `Vision.View`: it connects `Vision.View.Subscribers`, which knows the viewers,
  # with `Vision.View.EncoderControl`, which encodes the pictures. It does not wait for a viewer,
  # the camera or ffmpeg.
  use GenServer
  alias Hal.Frame
  alias Hal.Device.Explanation
  alias Vision.View.{EncoderControl, Subscribers}

  @doc "The error for a viewer on another node than the camera's."
  @spec elsewhere(camera :: node(), viewer :: node()) :: String.t()
  def elsewhere(camera, viewer),
    do: "pictures do not leave their node: the camera is on #{camera}, the viewer on #{viewer}"

  @impl GenServer
  def init(options) do
    # So that the end of an ffmpeg is a message.
    Process.flag(:trap_exit, true)
    :atomics.put(options.demand, 1, 0)

    {:ok,
     %{
       demand: options.demand,
       subscribers: Subscribers.new(options.viewers),
       people: %{},
       maker: EncoderControl.new(options.ffmpeg),
       snapshot_ms: options.snapshot_ms,
       timer: nil,
       camera: :online
     }}
  end

  @impl GenServer
  def handle_call(:status, _from, %{maker: maker} = s) do
    encoder = if maker.encoder, do: :open, else: :closed
    looking = %{viewers: Subscribers.size(s.subscribers), encoder: encoder}
    {:reply, maker |> Map.take([:made, :failed, :why]) |> Map.merge(looking), s}
  end

  def handle_call(_request, {pid, _tag}, s) when node(pid) != node(),
    do: {:reply, {:error, elsewhere(node(), node(pid))}, s}

  def handle_call({:looks, ref}, {pid, _tag}, s),
    do: {:reply, match?(%{^ref => {^pid, _monitor}}, s.people), s}

  def handle_call({:subscribe, ref, every_ms}, {pid, _tag}, s)
      when is_reference(ref) and is_integer(every_ms) and every_ms > 0 do
    case join(s, ref, every_ms) do
      {:ok, s} ->
        people = Map.put(s.people, ref, {pid, Process.monitor(pid)})
        {:reply, :ok, look(%{s | people: people})}

      error ->
        {:reply, error, s}
    end
  end

  def handle_call(:snapshot, from, s) do
    case join(s, {:once, from}, :once) do
      {:ok, s} ->
        Process.send_after(self(), {:too_late, from}, s.snapshot_ms)
        {:noreply, look(s)}

      error ->
        {:reply, error, s}
    end
  end

  @impl GenServer
  def handle_cast({:frame, %Frame{} = frame}, s), do: {:noreply, s |> begin(frame) |> look()}
  def handle_cast({:camera, condition}, s), do: {:noreply, %{s | camera: condition}}
  def handle_cast({:unsubscribe, ref}, s), do: {:noreply, s |> leave(ref) |> look()}

  def handle_cast({:next, ref}, s),
    do: {:noreply, look(%{s | subscribers: Subscribers.ask(s.subscribers, ref)})}

  # Tried again at the next request.
  def handle_cast(:no_frames, s),
    do: {:noreply, refuse(s, "this camera gives coloured blobs, and no pictures")}

  @impl GenServer
  def handle_info(:look, s), do: {:noreply, look(%{s | timer: nil})}

  def handle_info({:too_late, from}, s) do
    if Subscribers.member?(s.subscribers, {:once, from}),
      do: GenServer.reply(from, {:error, why_none(s)})

    {:noreply, look(%{s | subscribers: Subscribers.leave(s.subscribers, {:once, from})})}
  end

  def handle_info({:DOWN, monitor, :process, _pid, _reason}, s) do
    gone = for {ref, {_pid, ^monitor}} <- s.people, do: ref
    {:noreply, gone |> Enum.reduce(s, &leave(&2, &1)) |> look()}
  end

  def handle_info(message, s) do
    case EncoderControl.handle(s.maker, message, Hal.Clock.now_ms()) do
      {:picture, picture, maker} -> {:noreply, %{s | maker: maker} |> show(picture) |> look()}
      {:ok, maker} -> {:noreply, %{s | maker: maker}}
      {:error, line, maker} -> {:noreply, %{s | maker: maker} |> refuse(line) |> look()}
      # From an encoder that is closed by now.
      :unknown -> {:noreply, s}
    end
  end

  @impl GenServer
  def terminate(_reason, s), do: EncoderControl.close(s.maker)

  defp join(s, id, every) do
    with :ok <- EncoderControl.able(s.maker),
         {:ok, subscribers} <- Subscribers.join(s.subscribers, id, every, Hal.Clock.now_ms()) do
      {:ok, %{s | subscribers: subscribers}}
    else
      {:error, :full} -> {:error, "#{Subscribers.size(s.subscribers)} viewers are the maximum"}
      error -> error
    end
  end

  defp leave(s, ref) do
    case Map.pop(s.people, ref) do
      {nil, _people} ->
        s

      {{_pid, monitor}, people} ->
        Process.demonitor(monitor, [:flush])
        %{s | people: people, subscribers: Subscribers.leave(s.subscribers, ref)}
    end
  end

  # Requests a frame from the camera if a picture is due, and sets a timer if not.
  defp look(s) do
    if s.timer, do: Process.cancel_timer(s.timer)

    case wait(s, Hal.Clock.now_ms()) do
      0 ->
        :atomics.put(s.demand, 1, 1)
        %{s | timer: nil}

      wait ->
        :atomics.put(s.demand, 1, 0)
        %{s | timer: if(is_integer(wait), do: Process.send_after(self(), :look, wait))}
    end
  end

  defp wait(s, now) do
    case {EncoderControl.rests(s.maker, now), Subscribers.due(s.subscribers, now)} do
      {:busy, _due} -> :busy
      {_rests, :never} -> :never
      {rests, due} -> max(rests, due)
    end
  end

  # A frame that was still on its way when its last viewer left, or the encoder failed, is
  # dropped.
  defp begin(s, frame) do
    now = Hal.Clock.now_ms()

    with 0 <- wait(s, now), {:error, line, maker} <- EncoderControl.begin(s.maker, frame, now) do
      refuse(%{s | maker: maker}, line)
    else
      {:ok, maker} -> %{s | maker: maker}
      _not_now -> s
    end
  end

  defp show(s, picture) do
    {ids, subscribers} = Subscribers.serve(s.subscribers, Hal.Clock.now_ms())
    for id <- ids, do: hand_over(id, s.people, picture)
    %{s | subscribers: subscribers}
  end

  defp hand_over({:once, from}, _people, picture), do: GenServer.reply(from, {:ok, picture})

  defp hand_over(ref, people, picture) do
    {pid, _monitor} = Map.fetch!(people, ref)
    send(pid, {:picture, ref, picture})
  end

  # Requests for one picture are answered with the error; subscribers go on waiting.
  defp refuse(s, line) do
    Enum.reduce(Subscribers.ids(s.subscribers), s, fn
      {:once, from} = id, s ->
        GenServer.reply(from, {:error, line})
        %{s | subscribers: Subscribers.leave(s.subscribers, id)}

      _looking, s ->
        s
    end)
  end

  defp why_none(%{camera: {:offline, reason}}),
    do: "the camera is offline (#{Explanation.offline({nil, []}, reason)})"

  defp why_none(s), do: "the camera gave no frame within #{s.snapshot_ms} ms"

  # Not the robot's clock, which may be that of a simulator: pictures are made for people.
end
