defmodule Record.Recorder.Pictures do
  @moduledoc false
  # Takes pictures of robots' cameras for their recorder, some a second: a viewer of each robot's
  # `Vision.View`. No process of a robot waits for it, and it asks for a robot's next picture only when
  # the recorder has taken the last one, so that at most one of each robot is under way.
  #
  # A robot that has no camera, or none yet, is asked again after a second. It belongs to the recorder,
  # which starts it and to which it sends `{:picture, robot, %Vision.View.Picture{}}`.
  use GenServer
  alias Robot.Names
  alias Vision.View

  @again_ms 1_000

  @doc "Starts it for the calling recorder: the robots, and the pictures a second of each."
  @spec start_link([atom()], rate :: number()) :: GenServer.on_start()
  def start_link(robots, rate),
    do: GenServer.start_link(__MODULE__, {self(), robots, rate})

  @doc "The recorder has taken a robot's picture."
  @spec taken(pid(), atom()) :: :ok
  def taken(pictures, robot), do: GenServer.cast(pictures, {:taken, robot})

  @impl GenServer
  def init({recorder, robots, rate}) do
    # A link does not end it with a recorder that ends in order.
    gone = Process.monitor(recorder)
    s = %{recorder: recorder, gone: gone, rate: rate, refs: Map.new(robots, &{&1, nil})}
    {:ok, s, {:continue, :look}}
  end

  @impl GenServer
  def handle_continue(:look, s), do: {:noreply, look(s)}

  @impl GenServer
  def handle_cast({:taken, robot}, s) do
    with %{^robot => ref} when ref != nil <- s.refs, do: View.next(view(robot), ref)
    {:noreply, s}
  end

  @impl GenServer
  def handle_info({:picture, ref, picture}, s) do
    with {robot, ^ref} <- Enum.find(s.refs, fn {_robot, known} -> known == ref end),
         do: send(s.recorder, {:picture, robot, picture})

    {:noreply, s}
  end

  def handle_info({:DOWN, gone, :process, _pid, _reason}, %{gone: gone} = s),
    do: {:stop, :normal, s}

  # The view crashed, or its robot ended, and may be back soon.
  def handle_info({:DOWN, ref, :process, _pid, _reason}, s) do
    refs = Map.new(s.refs, fn {robot, known} -> {robot, if(known != ref, do: known)} end)
    {:noreply, %{s | refs: refs}}
  end

  def handle_info(:look, s), do: {:noreply, look(s)}
  def handle_info(_late, s), do: {:noreply, s}

  defp look(s) do
    _timer = Process.send_after(self(), :look, @again_ms)

    %{s | refs: Map.new(s.refs, fn {robot, ref} -> {robot, ref || subscribe(robot, s.rate)} end)}
  end

  defp subscribe(robot, rate) do
    case View.subscribe(view(robot), rate: rate) do
      {:ok, ref} -> ref
      {:error, _no_camera_yet} -> nil
    end
  end

  defp view(robot), do: Names.via(robot, :view)
end
