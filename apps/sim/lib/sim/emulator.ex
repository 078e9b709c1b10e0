defmodule Sim.Emulator do
  @moduledoc """
  Runs an emulated device (`Sim.Emulator.Core`) on a pseudo-terminal, with a body: the body does what the device
  commands, and the device gets what the body senses. At the other end, the symbolic link, a driver finds it like a real
  device.

  | option | meaning |
  |---|---|
  | `:core` | `{module, options}`, a `Sim.Emulator.Core` such as `Sim.Emulator.RFlexController`, `.Kobuki`, `.ViscaCamera` or `.RPLidar` |
  | `:link` | path of the symbolic link to the pseudo-terminal |
  | `:body` | `{driver, options}`, a `Hal.Drive`, `Hal.Ptz` or `Hal.Lidar` such as `Sim.Device.Drive`, or `nil` for none |
  | `:wire` | faults of the line in both directions, as in `Sim.Emulator.Wire` |
  | `:name` | as in `GenServer` |

  If the body does not exist yet, or the line cannot be opened, it tries again until that works.
  The event `[:sim, :emulator, :line]` reports a line that fails.

  Faults of hardware: `unplug/1` removes the line, so that the driver's end is connected to
  nothing, and `plug/1` restores it; `freeze/1` makes the device neither hear nor send anything,
  with wheels that the body itself stops, until `thaw/1`; `restart/1` is its power switch.
  """
  use GenServer
  @behaviour Hal.Emulated
  @behaviour Hal.DriveCase
  @behaviour Hal.ScanCase
  alias Hal.{Event, Serial}
  alias Sim.Emulator.Wire

  @retry_ms 100

  @enforce_keys [:module, :core, :link, :driver, :to_core, :from_core]
  defstruct @enforce_keys ++
              [line: nil, body: nil, plugged?: true, frozen?: false, timer: nil, reason: nil]

  @doc "Starts the device; the error says in one line what is wrong with its options."
  @impl Hal.Emulated
  @spec start_link(keyword()) :: GenServer.on_start() | {:error, line :: String.t()}
  def start_link(options) do
    {name, options} = Keyword.split(options, [:name])
    options = Keyword.validate!(options, [:core, :link, body: nil, wire: []])
    {module, core_options} = options[:core]

    with {:ok, core} <- module.new(core_options, Hal.Clock.now_ms()),
         {:ok, to_core} <- Wire.new([way: 0] ++ options[:wire]),
         {:ok, from_core} <- Wire.new([way: 1] ++ options[:wire]) do
      GenServer.start_link(
        __MODULE__,
        %__MODULE__{
          module: module,
          core: core,
          link: options[:link],
          driver: options[:body],
          to_core: to_core,
          from_core: from_core
        },
        name
      )
    end
  end

  @doc "Removes the line."
  @impl Hal.Emulated
  @spec unplug(GenServer.server()) :: :ok
  def unplug(emulator), do: GenServer.call(emulator, :unplug)

  @doc "Restores the line, under the same link."
  @impl Hal.Emulated
  @spec plug(GenServer.server()) :: :ok
  def plug(emulator), do: GenServer.call(emulator, :plug)

  @doc "Freezes the device: it hears nothing, sends nothing, and commands nothing of its body."
  @spec freeze(GenServer.server()) :: :ok
  def freeze(emulator), do: GenServer.call(emulator, {:freeze, true})

  @doc "Lets the device go on where it was."
  @spec thaw(GenServer.server()) :: :ok
  def thaw(emulator), do: GenServer.call(emulator, {:freeze, false})

  @doc "Switches the device off and on."
  @impl Hal.Emulated
  @spec restart(GenServer.server()) :: :ok
  def restart(emulator), do: GenServer.call(emulator, {:change, :restart, []})

  @doc "Puts bytes of noise on the line, as if the device had sent them."
  @impl Hal.Emulated
  @spec noise(GenServer.server(), binary()) :: :ok
  def noise(emulator, bytes), do: GenServer.call(emulator, {:noise, bytes})

  @doc "What a lidar has around it from now on, if it has no body that says so."
  @impl Hal.ScanCase
  @spec see(GenServer.server(), Hal.Scan.t()) :: :ok
  def see(emulator, scan), do: change(emulator, :feel, [{:scan, scan}, Hal.Clock.now_ms()])

  @doc """
  Calls `function` of the core's module with the core and these arguments, such as `:stick` of a
  controller.
  """
  @spec change(GenServer.server(), atom(), list()) :: :ok
  def change(emulator, function, arguments),
    do: GenServer.call(emulator, {:apply, function, arguments})

  @doc "Sets the faults of the line from now on, as in `Sim.Emulator.Wire`."
  @spec spoil(GenServer.server(), keyword()) :: :ok | {:error, line :: String.t()}
  def spoil(emulator, options), do: GenServer.call(emulator, {:spoil, options})

  @doc "The speed that the motors of a base give its wheels now."
  @impl Hal.DriveCase
  @spec wheels(GenServer.server()) :: Hal.Twist.t()
  def wheels(emulator), do: GenServer.call(emulator, :wheels)

  @doc "The current state of the device."
  @spec core(GenServer.server()) :: term()
  def core(emulator), do: GenServer.call(emulator, :core)

  @impl GenServer
  def init(s) do
    # So that `terminate/2` runs, and the crash of a port program is noticed.
    Process.flag(:trap_exit, true)
    {:ok, s |> open() |> attach() |> pump()}
  end

  @impl GenServer
  def handle_call(:core, _from, s), do: {:reply, s.core, s}

  def handle_call(:wheels, _from, s),
    do: {:reply, s.module.wheels(s.core, Hal.Clock.now_ms()), s}

  def handle_call({:noise, bytes}, _from, s) do
    if s.line, do: Serial.write(s.line, bytes)
    {:reply, :ok, s}
  end

  def handle_call(:unplug, _from, s) do
    s = close(%{s | plugged?: false})
    {:reply, :ok, %{s | to_core: Wire.pull(s.to_core), from_core: Wire.pull(s.from_core)}}
  end

  def handle_call(:plug, _from, s) do
    s = %{s | plugged?: true, to_core: Wire.plug(s.to_core), from_core: Wire.plug(s.from_core)}
    {:reply, :ok, if(s.line, do: s, else: open(s))}
  end

  def handle_call({:freeze, frozen?}, _from, s), do: {:reply, :ok, pump(%{s | frozen?: frozen?})}

  def handle_call({:change, :restart, []}, _from, s),
    do: {:reply, :ok, pump(%{s | core: s.module.restart(s.core, Hal.Clock.now_ms())})}

  def handle_call({:apply, function, arguments}, _from, s),
    do: {:reply, :ok, pump(%{s | core: apply(s.module, function, [s.core | arguments])})}

  def handle_call({:spoil, options}, _from, s) do
    with {:ok, to_core} <- Wire.new([way: 0] ++ options),
         {:ok, from_core} <- Wire.new([way: 1] ++ options) do
      {:reply, :ok, %{s | to_core: to_core, from_core: from_core}}
    else
      error -> {:reply, error, s}
    end
  end

  @impl GenServer
  def handle_info({:pump, at_ms}, %{timer: {_timer, at_ms}} = s),
    do: {:noreply, pump(%{s | timer: nil})}

  def handle_info({:pump, _old}, s), do: {:noreply, s}
  def handle_info(:open, %{line: nil, plugged?: true} = s), do: {:noreply, open(s)}
  def handle_info(:open, s), do: {:noreply, s}
  def handle_info(:attach, %{body: nil} = s), do: {:noreply, attach(s)}
  def handle_info(:attach, s), do: {:noreply, s}

  def handle_info(message, %{line: line} = s) do
    case line && Serial.handle(line, message) do
      {:data, bytes} ->
        {:noreply, pump(%{s | to_core: Wire.put(s.to_core, bytes, Hal.Clock.now_ms())})}

      {:error, reason} ->
        {:noreply, s |> close() |> failed(reason)}

      _not_the_line ->
        {:noreply, felt(s, message)}
    end
  end

  @impl GenServer
  def terminate(_reason, s) do
    close(s)
    with {driver, _options} <- s.driver, {:body, body} <- s.body, do: driver.terminate(body)
  end

  defp open(s) do
    case Serial.open(pty: s.link) do
      {:ok, line} -> %{s | line: line, reason: nil}
      {:error, reason} -> failed(s, reason)
    end
  end

  defp close(%{line: nil} = s), do: s

  defp close(%{line: line} = s) do
    :ok = Serial.close(line)
    %{s | line: nil}
  end

  defp failed(s, reason) do
    about = %{link: s.link, reason: reason}

    if reason != s.reason,
      do: Event.execute([:sim, :emulator, :line], %{at_ms: Hal.Clock.now_ms()}, about)

    Process.send_after(self(), :open, @retry_ms)
    %{s | reason: reason}
  end

  defp attach(%{driver: nil} = s), do: s

  defp attach(%{driver: {driver, options}} = s) do
    case driver.init(options) do
      {:ok, body} -> %{s | body: {:body, body}}
      {:error, _no_world_yet} -> again(s)
    end
  end

  defp again(s) do
    Process.send_after(self(), :attach, @retry_ms)
    %{s | body: nil}
  end

  defp felt(%{body: nil} = s, _message), do: s

  defp felt(%{driver: {driver, _options}, body: {:body, body}} = s, message) do
    case driver.handle_message(message, body) do
      {:ok, [], body} ->
        %{s | body: {:body, body}}

      {:ok, readings, body} ->
        s = %{s | body: {:body, body}}
        at_ms = Hal.Clock.now_ms()
        feel = fn reading, core -> s.module.feel(core, reading, at_ms) end
        if s.frozen?, do: s, else: pump(%{s | core: Enum.reduce(readings, s.core, feel)})

      {:error, _reason, body} ->
        driver.terminate(body)
        again(s)
    end
  end

  # Does everything that is due: bytes in, bytes out, the body, and the next timer.
  defp pump(%{frozen?: true} = s) do
    {_unheard, to_core} = Wire.take(s.to_core, Hal.Clock.now_ms())
    schedule(%{s | to_core: to_core}, [Wire.next_ms(to_core)])
  end

  defp pump(s) do
    at_ms = Hal.Clock.now_ms()
    {heard, to_core} = Wire.take(s.to_core, at_ms)
    {said, wishes, core} = s.core |> s.module.hear(heard, at_ms) |> s.module.run(at_ms)
    {sent, from_core} = s.from_core |> Wire.put(said, at_ms) |> Wire.take(at_ms)
    # If the line cannot take it, it is lost.
    if s.line && sent != <<>>, do: Serial.write(s.line, sent)
    s = Enum.reduce(wishes, %{s | core: core, to_core: to_core, from_core: from_core}, &wish/2)

    schedule(s, [s.module.next_ms(core), Wire.next_ms(to_core), Wire.next_ms(from_core)])
  end

  defp wish(_wish, %{body: nil} = s), do: s

  defp wish(wish, %{driver: {driver, _options}, body: {:body, body}} = s) do
    result =
      case wish do
        {:drive, twist} -> driver.drive(twist, body)
        {:look, pan, tilt} -> driver.look(pan, tilt, body)
        {:zoom, angle} -> driver.zoom(angle, body)
      end

    case result do
      {:ok, body} ->
        %{s | body: {:body, body}}

      {:error, _reason, body} ->
        driver.terminate(body)
        again(s)
    end
  end

  defp schedule(s, times) do
    case {Enum.min(Enum.reject(times, &is_nil/1), fn -> nil end), s.timer} do
      {at_ms, {_timer, at_ms}} ->
        s

      {at_ms, timer} ->
        with {timer, _at_ms} <- timer, do: Process.cancel_timer(timer)

        %{
          s
          | timer: at_ms && {Process.send_after(self(), {:pump, at_ms}, at_ms, abs: true), at_ms}
        }
    end
  end
end
