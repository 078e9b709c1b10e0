defmodule Sim.EmulatedWorld do
  @moduledoc """
  A world with a robot `:mag1` before which a landmark stands or does not, as what a simulated camera is opened at: the `link` is
  the name of the world. For `Hal.CameraCase`.
  """
  use GenServer
  @behaviour Hal.Emulated
  @behaviour Hal.CameraCase
  alias Hal.{Pose, Profile}
  alias Sim.World

  @landmark {0.0, 0.0}

  @impl Hal.Emulated
  def start_link(options), do: GenServer.start_link(__MODULE__, Keyword.fetch!(options, :link))

  @impl Hal.Emulated
  def unplug(emulated), do: GenServer.call(emulated, :unplug)

  @impl Hal.Emulated
  def plug(emulated), do: GenServer.call(emulated, :plug)

  @impl Hal.Emulated
  def restart(emulated) do
    :ok = unplug(emulated)
    plug(emulated)
  end

  @impl Hal.Emulated
  def noise(emulated, bytes), do: GenServer.call(emulated, {:noise, bytes})

  @impl Hal.CameraCase
  def show(emulated, scene), do: GenServer.call(emulated, {:show, scene})

  @impl Hal.CameraCase
  def scene(%Vision.Detections{blobs: blobs}), do: if(blobs == [], do: 0, else: 1)

  def scene(%Hal.Frame{} = frame) do
    {:ok, blobs} = Vision.blobs(frame, World.colours())
    if blobs == [], do: 0, else: 1
  end

  @impl GenServer
  def init(link) do
    Process.flag(:trap_exit, true)
    {:ok, open(%{link: link, scene: 0, server: nil})}
  end

  @impl GenServer
  def handle_call(:unplug, _from, s) do
    :ok = GenServer.stop(s.server)
    {:reply, :ok, %{s | server: nil}}
  end

  def handle_call(:plug, _from, s), do: {:reply, :ok, open(s)}

  def handle_call({:show, scene}, _from, s) do
    World.Server.change(s.server, {:move, landmark(scene)})
    {:reply, :ok, %{s | scene: scene}}
  end

  # What a camera hears of a world is terms.
  def handle_call({:noise, bytes}, _from, s) do
    for {_device, pid} <- :sys.get_state(s.server).devices,
        do: send(pid, {:world, s.server, bytes})

    {:reply, :ok, s}
  end

  @impl GenServer
  def handle_info({:EXIT, _server, :normal}, s), do: {:noreply, s}

  @impl GenServer
  def terminate(_reason, s), do: if(s.server, do: GenServer.stop(s.server))

  defp open(s) do
    {:ok, map} = Sim.Floorplan.open("hall", 1)
    robot = %{id: :mag1, profile: Profile.magellan(), pose: Pose.new(-2, 0)}
    world = World.new!(map: map, robots: [robot], landmark: landmark(s.scene), noise: :off)
    {:ok, server} = World.Server.start_link(name: s.link, world: world)
    %{s | server: server}
  end

  defp landmark(0), do: nil
  defp landmark(1), do: @landmark
end
