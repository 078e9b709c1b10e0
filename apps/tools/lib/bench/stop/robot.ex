defmodule Bench.Stop.Robot do
  @moduledoc false
  # Runs the robot that is measured, in a VM of its own: the whole tree, with the driver of real bases on a serial line,
  # armed by hand as real robots are. Its mission drives straight on, and raises on command. Called over standard input.
  @behaviour Robot.Behaviour
  alias Bench.Stop.WireTap
  alias Hal.{Device, Event, Twist}
  alias Robot.{Names, Wish}
  alias Robot.Control.Pilot

  @id :mag1
  @deadline_ms 10_000
  @look_ms 10

  @doc "Starts the robot on this line. Returns when it is online and armed."
  @spec main(Path.t()) :: :ok
  def main(link) do
    Application.put_env(:logger, :level, :none)
    Application.put_env(:swarm, :mesh, false)
    {:ok, _apps} = Application.ensure_all_started(:swarm)
    :persistent_term.put({__MODULE__, :raise?}, false)
    :ok = Event.attach(__MODULE__, [:hal, :device, :offline], &__MODULE__.note/4, nil)

    config =
      Robot.Config.new!(
        id: @id,
        profile: Hal.Profile.magellan(),
        arm: :manual,
        drive:
          {Hal.RFlex.Driver,
           port: link,
           conversions: [
             distance: 31_387.0,
             angle: 4654.2,
             range: 1474.0,
             ir_a: 4000.0,
             ir_b: -2.0
           ]}
      )

    {:ok, _robot} = Robot.Fleet.start_robot(Robot.Fleet, Swarm.Comms.join(config))
    arm()
  end

  @doc "Arms it as soon as the drive can be armed."
  @spec arm() :: :ok
  def arm, do: until(fn -> Device.arm(Names.via(@id, :drive)) == :ok end)

  @doc """
  Drives it again after its VM was frozen: its line has said the last words while the wheels turned, and is lost.
  """
  @spec thawed() :: :ok
  def thawed do
    until(fn -> match?({:error, _reason}, arming()) end)
    :ok = acknowledge()
    arm()
  end

  @doc "Lets it drive at this speed."
  @spec roll(float()) :: :ok
  def roll(speed) do
    :persistent_term.put({__MODULE__, :raise?}, false)
    # It may have crashed just now.
    until(fn -> Names.whereis(@id, :pilot) != nil end)
    # A base whose process had no processor for half a second is offline for as long.
    until(fn -> Pilot.start(@id, __MODULE__.Mission, speed: speed) == :ok end)
  end

  @doc "Makes the next tick of its behaviour raise; returns when it did."
  @spec crash() :: at_us :: integer()
  def crash do
    :persistent_term.put({__MODULE__, :raise?}, true)
    until(fn -> is_integer(:persistent_term.get({__MODULE__, :raise?})) end)
    :persistent_term.get({__MODULE__, :raise?})
  end

  @doc "Freezes the executive, or lets it go on."
  @spec freeze(boolean()) :: :ok
  def freeze(true), do: :sys.suspend(Names.via(@id, :executive))
  def freeze(false), do: :sys.resume(Names.via(@id, :executive))

  @doc """
  When the drive was last offline, in us; waits for that if it was not offline since `since_us`.
  """
  @spec offline(since_us :: integer()) :: at_us :: integer()
  def offline(since_us) do
    until(fn -> :persistent_term.get({__MODULE__, :offline}, 0) >= since_us end)
    :persistent_term.get({__MODULE__, :offline})
  end

  @doc "The arming state of the wheels."
  @spec arming() :: Hal.Device.Arming.state()
  def arming, do: Device.arming(Names.via(@id, :drive)).state

  @doc "Acknowledges the loss of the line once it is back."
  @spec acknowledge() :: :ok
  def acknowledge, do: Device.acknowledge(Names.via(@id, :drive))

  @doc false
  @spec note(Event.name(), map(), map(), term()) :: :ok
  def note(_event, _measured, %{device: :drive}, _config),
    do: :persistent_term.put({__MODULE__, :offline}, WireTap.now_us())

  def note(_event, _measured, _another_device, _config), do: :ok

  @impl Robot.Behaviour
  def new(speed: speed), do: {__MODULE__, speed}

  @impl Robot.Behaviour
  def tick(_percept, speed) do
    if :persistent_term.get({__MODULE__, :raise?}) == true do
      :persistent_term.put({__MODULE__, :raise?}, WireTap.now_us())
      raise "it was told to"
    end

    {:running, Wish.new(:roll, Twist.new(speed, 0.0), 0.6), {__MODULE__, speed}}
  end

  defp until(done?, deadline \\ Hal.Clock.now_ms() + @deadline_ms) do
    cond do
      done?.() ->
        :ok

      Hal.Clock.now_ms() > deadline ->
        exit(:timeout)

      true ->
        receive do
        after
          @look_ms -> until(done?, deadline)
        end
    end
  end

  defmodule Mission do
    @moduledoc false
    @behaviour Robot.Mission
    alias Bench.Stop.Robot, as: Roller

    @impl Robot.Mission
    def init(_robot, options), do: {:rolling, options, [{:goal, :roll, {Roller, options}}]}

    @impl Robot.Mission
    def handle(_event, options), do: {:rolling, options, []}
  end
end
