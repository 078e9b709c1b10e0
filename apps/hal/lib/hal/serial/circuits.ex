if Code.ensure_loaded?(Circuits.UART) do
  defmodule Hal.Serial.Circuits do
    @moduledoc """
    Opens a serial line (`Hal.Serial`) through `circuits_uart`, for programs that use it anyway (`MIX_TARGET` other than
    `host`). Robots with wheels should use `Hal.Serial.Native`, because here **this VM writes the last words**:

      * when the line is closed, its owner ends or is silent, they are written; after a silence the line is lost
      * when the VM itself is killed, frozen or has crashed, they are **not**: the robot goes on
        until its controller, or somebody at the emergency stop, ends that
      * when a frozen VM thaws, they are written then, and the line is lost, as after any silence; but bytes that
        `circuits_uart` had taken before may leave first, and after a suspension of the machine none of this happens

    A process between the line and its owner (`Hal.Serial.Circuits.Server`) writes, so that the
    owner does not wait. Incoming bytes pile up in the mailbox of an owner that does not take
    them. There is no `:pty`.

    Errors of `open/1`: `:enoent`, `:eacces`, `:ebusy`, `:eio`, `:enotty`, `:einval`,
    `{:os, text}`, `{:exit, reason}`. Later ones: `:unplugged`, `:last_words`, `{:exit, reason}`; of `write/2`
    and similar functions `:overrun`, `:closed`.
    """
    @behaviour Hal.Serial.Line
    alias Hal.Serial.Circuits
    alias Hal.Serial.Line

    @out_most 4096
    @close_ms 2_000

    @enforce_keys [:keeper, :monitor, :under_way]
    defstruct @enforce_keys

    @opaque t :: %__MODULE__{
              keeper: pid(),
              monitor: reference(),
              under_way: :atomics.atomics_ref()
            }

    @impl Line
    def open(options) do
      under_way = :atomics.new(1, [])

      case GenServer.start(Circuits.Server, {self(), under_way, options}) do
        {:ok, keeper} ->
          monitor = Process.monitor(keeper)
          {:ok, %__MODULE__{keeper: keeper, monitor: monitor, under_way: under_way}}

        {:error, {:shutdown, reason}} ->
          {:error, reason}

        {:error, reason} ->
          {:error, {:exit, reason}}
      end
    end

    @impl Line
    def write(%__MODULE__{} = line, bytes) do
      size = IO.iodata_length(bytes)

      cond do
        not Process.alive?(line.keeper) -> {:error, :closed}
        :atomics.get(line.under_way, 1) + size > @out_most -> {:error, :overrun}
        true -> put(line, size, bytes)
      end
    end

    @impl Line
    def last_words(%__MODULE__{} = line, words), do: tell(line, {:last_words, words})

    @impl Line
    def keep_alive(%__MODULE__{} = line), do: tell(line, :keep_alive)

    @impl Line
    def close(%__MODULE__{keeper: keeper, monitor: monitor}) do
      # A new one, because the line may have reported its end already.
      Process.demonitor(monitor, [:flush])
      closing = Process.monitor(keeper)
      GenServer.cast(keeper, :close)

      receive do
        {:DOWN, ^closing, :process, _pid, _reason} -> :ok
      after
        @close_ms ->
          Process.demonitor(closing, [:flush])
          Process.exit(keeper, :kill)
      end

      forget(keeper)
    end

    @impl Line
    def handle(%__MODULE__{keeper: keeper, monitor: monitor}, message) do
      case message do
        {^keeper, {:data, bytes}} -> {:data, bytes}
        {^keeper, {:error, reason}} -> {:error, reason}
        {:DOWN, ^monitor, :process, _pid, reason} -> {:error, {:exit, reason}}
        _other -> :unknown
      end
    end

    defp put(line, size, bytes) do
      :atomics.add(line.under_way, 1, size)
      GenServer.cast(line.keeper, {:write, size, bytes})
    end

    defp tell(line, what) do
      if Process.alive?(line.keeper),
        do: GenServer.cast(line.keeper, what),
        else: {:error, :closed}
    end

    defp forget(keeper) do
      receive do
        {^keeper, _message} -> forget(keeper)
      after
        0 -> :ok
      end
    end
  end
end
