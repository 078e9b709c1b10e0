defmodule Bench.Bases.Holder do
  @moduledoc false
  # Drives a base in a VM of its own, which is killed or frozen: the device with its driver, and a process that repeats an order
  # as a gate does. Called over standard input.
  use GenServer
  alias Hal.{Device, Twist}

  @order_ms 50

  @doc "Starts the device on this line, and drives at this speed (m/s)."
  @spec main({module(), keyword()}, Path.t(), float()) :: :ok
  def main({driver, options}, link, speed) do
    Application.put_env(:logger, :level, :none)
    {:ok, _apps} = Application.ensure_all_started(:hal)
    driver = {driver, [port: link] ++ options}
    {:ok, _holder} = GenServer.start(__MODULE__, {driver, speed}, name: __MODULE__)
    :ok
  end

  @doc "From now on arms no more: what a cause disarms stays so."
  @spec arm_no_more() :: :ok
  def arm_no_more, do: GenServer.call(__MODULE__, :arm_no_more)

  @doc "From now on orders this speed; `nil` for silence."
  @spec order(float() | nil) :: :ok
  def order(speed), do: GenServer.call(__MODULE__, {:order, speed})

  @doc "The port programs of the device, as processes of the operating system."
  @spec programs() :: [String.t()]
  def programs, do: GenServer.call(__MODULE__, :programs)

  @impl GenServer
  def init({driver, speed}) do
    {:ok, device} = Device.start_link(kind: :drive, driver: driver, arm: :manual)
    {:ok, _timer} = :timer.send_interval(@order_ms, :drive)
    {:ok, %{device: device, speed: speed, arms?: true}}
  end

  @impl GenServer
  def handle_call(:arm_no_more, _from, s), do: {:reply, :ok, %{s | arms?: false}}
  def handle_call({:order, speed}, _from, s), do: {:reply, :ok, drive(%{s | speed: speed})}

  def handle_call(:programs, _from, s) do
    {:links, links} = Process.info(s.device, :links)
    ports = for port <- links, is_port(port), do: Port.info(port, :os_pid)
    {:reply, for({:os_pid, pid} <- ports, do: "#{pid}"), s}
  end

  @impl GenServer
  def handle_info(:drive, s), do: {:noreply, drive(s)}

  defp drive(%{speed: nil} = s), do: s

  defp drive(s) do
    # As a person does, until it drives.
    if s.arms? do
      _moved_or_not = Device.acknowledge(s.device)
      _ready_or_not_yet = Device.arm(s.device)
    end

    Device.drive(s.device, Twist.new(s.speed, 0.0))
    s
  end
end
