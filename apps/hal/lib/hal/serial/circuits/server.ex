if Code.ensure_loaded?(Circuits.UART) do
  defmodule Hal.Serial.Circuits.Server do
    @moduledoc """
    Holds a line of `Hal.Serial.Circuits`: writes for the owner, sends it what arrives as `{pid, {:data, bytes} |
    {:error, reason}}`, keeps the timer of its signs of life, and writes the last words when the owner is silent or
    ends. After an error it only waits to be closed.
    """
    use GenServer
    alias Circuits.UART

    # If a write takes longer than this, the line is stuck.
    @write_ms 100

    @enforce_keys [:uart, :owner, :under_way, :words, :keep_alive_ms, :life_ms]
    defstruct @enforce_keys ++ [silence: nil, open?: true, lost?: false]

    @impl GenServer
    def init({owner, under_way, options}) do
      Process.flag(:trap_exit, true)
      Process.monitor(owner)
      {:ok, uart} = UART.start_link()

      settings = [
        active: true,
        id: :pid,
        speed: options[:speed],
        data_bits: 8,
        stop_bits: 1,
        parity: :none,
        flow_control: :none
      ]

      case UART.open(uart, options[:port], settings) do
        :ok ->
          keeper = %__MODULE__{
            uart: uart,
            owner: owner,
            under_way: under_way,
            words: options[:last_words],
            keep_alive_ms: options[:keep_alive_ms],
            life_ms: Hal.Clock.now_ms()
          }

          {:ok, alive(keeper)}

        {:error, reason} ->
          {:stop, {:shutdown, opening(reason)}}
      end
    end

    @impl GenServer
    def handle_cast({:write, size, bytes}, s) do
      s = alive(s)
      writes? = s.open? and not s.lost?
      result = if writes?, do: UART.write(s.uart, bytes, @write_ms), else: :ok
      :atomics.sub(s.under_way, 1, size)
      {:noreply, check(result, s)}
    end

    def handle_cast({:last_words, words}, s), do: {:noreply, alive(%{s | words: words})}
    def handle_cast(:keep_alive, s), do: {:noreply, alive(s)}

    def handle_cast(:close, s) do
      # What was written before must get out too.
      if s.open?, do: UART.drain(s.uart)
      if speaks?(s), do: UART.write(s.uart, s.words, @write_ms)
      shut(s)
    end

    @impl GenServer
    def handle_info({:circuits_uart, uart, {:error, reason}}, %{uart: uart} = s),
      do: {:noreply, check({:error, reason}, s)}

    def handle_info({:circuits_uart, uart, bytes}, %{uart: uart} = s) when is_binary(bytes) do
      send(s.owner, {self(), {:data, bytes}})
      {:noreply, s}
    end

    def handle_info({:silence, ref}, %{silence: {_timer, ref}} = s), do: {:noreply, lose(s)}

    def handle_info({:silence, _old}, s), do: {:noreply, s}

    def handle_info({:DOWN, _monitor, :process, owner, _reason}, %{owner: owner} = s) do
      speak(s)
      shut(s)
    end

    def handle_info({:EXIT, uart, reason}, %{uart: uart} = s), do: {:stop, {:shutdown, reason}, s}
    def handle_info(_other, s), do: {:noreply, s}

    # Ahead of the bytes that wait: those are late already.
    defp speak(s) do
      if speaks?(s) do
        UART.flush(s.uart, :transmit)
        UART.write(s.uart, s.words, @write_ms)
      else
        :ok
      end
    end

    # A line that is still open when its program ends is flushed, and would lose the last words.
    defp shut(s) do
      if s.open? do
        UART.drain(s.uart)
        UART.close(s.uart)
      end

      UART.stop(s.uart)
      {:stop, :normal, s}
    end

    defp speaks?(s), do: s.open? and s.words != <<>>

    # After a freeze a sign of life may be heard before the timer is.
    defp alive(s) do
      with {timer, _ref} <- s.silence, do: Process.cancel_timer(timer)
      now_ms = Hal.Clock.now_ms()
      s = if now_ms - s.life_ms > s.keep_alive_ms, do: lose(s), else: s
      ref = make_ref()
      timer = Process.send_after(self(), {:silence, ref}, s.keep_alive_ms)
      %{s | silence: {timer, ref}, life_ms: now_ms}
    end

    # Nothing follows the last words but those at the closing.
    defp lose(s) do
      if speaks?(s) and not s.lost? do
        s = check(speak(s), s)
        send(s.owner, {self(), {:error, :last_words}})
        %{s | lost?: true}
      else
        s
      end
    end

    defp check(:ok, s), do: s
    defp check({:error, _again}, %{open?: false} = s), do: s

    defp check({:error, reason}, s) do
      send(s.owner, {self(), {:error, later(reason)}})
      %{s | open?: false}
    end

    defp opening(:eagain), do: :ebusy
    defp opening(:eperm), do: :eacces
    defp opening(reason) when reason in [:enoent, :eacces, :eio, :enotty, :einval], do: reason
    defp opening(reason), do: {:os, "#{reason}"}

    defp later(:eagain), do: :overrun
    defp later(_gone), do: :unplugged
  end
end
