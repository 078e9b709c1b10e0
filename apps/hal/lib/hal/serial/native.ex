defmodule Hal.Serial.Native do
  @moduledoc """
  Opens a serial line through our own port program (`c_src/serial.c`), which outlives this VM long enough to write the
  last words. See `Hal.Serial`.

  The program keeps the timer of the signs of life. If it is killed itself, by the kernel or by an
  administrator's `kill -9`, there are no last words, and this side sees `{:exit, 137}`.

  Every message to the program has the time of the machine's monotonic clock. The program writes nothing that is older
  than `keep_alive_ms` (200 ms), and takes a greater distance between two signs of life for silence, however late it
  hears of them: a VM and a program that are frozen together, as when the machine is suspended, lose the line, too.
  This side judges by the same rule before it sends anything: the first function that is called after a silence
  returns `{:error, :last_words}`.

  If only the program is frozen (`kill -STOP`), nothing can be sent on the line, not even the last
  words. The program no longer answers the signs of life, and `keep_alive/1` returns
  `{:error, :frozen}` once five of them, and 500 ms, have passed without an answer. When the program resumes after
  more than `keep_alive_ms`, it writes the last words and nothing else, and the line is lost.

  Errors of `open/1`: `:enoent`, `:eacces`, `:ebusy` (another program has locked it), `:eio`,
  `:enodev`, `:enxio` (nothing behind it), `:enotty` (not a serial device), `:speed` (the hardware
  cannot), `:einval`, `:eexist` (`:pty` would replace something), `:timeout`, `:clock` (the VM
  reads another clock than the program), `{:os, text}`, `{:exit, status}`. Later ones:
  `:unplugged`, `:last_words`, `:terminated` (by SIGTERM or SIGHUP, after the last words), `{:exit, reason}`; of
  `write/2` and similar functions `:overrun`, `:closed`, `:last_words`; of `keep_alive/1` also `:frozen`.
  """
  @behaviour Hal.Serial.Line
  alias Hal.Serial.Line

  # The limits in c_src/serial.h are the same, or greater.
  @out_most 4096
  @take_step 16_384

  @open_ms 5_000
  @close_ms 2_000
  @frozen_ms 500
  @frozen_signs 5
  # For the time between the program's reading of the clock and ours, on a busy machine.
  @clocks_ms 5_000

  @reasons Map.new(
             ~w(enoent eacces ebusy eio enodev enxio enotty einval eexist speed unplugged terminated last_words)a,
             &{Atom.to_string(&1), &1}
           )

  # The counters: bytes written that the line has not taken; bytes taken that the program does not
  # know of yet; signs of life since the program's last answer, and when the first of these was
  # given; when the last one was given, and how many bytes of last words there are.
  @under_way 1
  @untold 2
  @unanswered 3
  @unanswered_ms 4
  @life_ms 5
  @words 6

  @enforce_keys [:port, :counters, :keep_alive_ms]
  defstruct @enforce_keys

  @opaque t :: %__MODULE__{
            port: port(),
            counters: :counters.counters_ref(),
            keep_alive_ms: pos_integer()
          }

  @impl Line
  def open(options) do
    program = Application.app_dir(:hal, "priv/serial")
    settings = [:binary, :exit_status, packet: 2, args: arguments(options)]
    port = Port.open({:spawn_executable, program}, settings)
    alive_ms = options[:keep_alive_ms]
    line = %__MODULE__{port: port, counters: :counters.new(6, []), keep_alive_ms: alive_ms}
    :counters.put(line.counters, @words, byte_size(options[:last_words]))

    receive do
      {^port, {:data, <<?O, at_ms::64>>}} -> same_clock(line, at_ms)
      {^port, {:data, <<?E, reason::binary>>}} -> give_up(line, reason(reason))
      {^port, {:exit_status, status}} -> give_up(line, {:exit, status})
      {:EXIT, ^port, reason} -> give_up(line, {:exit, reason})
    after
      @open_ms -> give_up(line, :timeout)
    end
  end

  @impl Line
  def write(%__MODULE__{} = line, bytes) do
    size = IO.iodata_length(bytes)

    cond do
      size == 0 -> keep_alive(line)
      fits?(line, size) or fits?(hear_taken(line), size) -> put(line, size, bytes)
      true -> {:error, :overrun}
    end
  end

  @impl Line
  def last_words(%__MODULE__{} = line, words) do
    with :ok <- sign(line, ?L, words, now_ms()),
         do: :counters.put(line.counters, @words, byte_size(words))
  end

  @impl Line
  def keep_alive(%__MODULE__{} = line) do
    at_ms = now_ms()

    cond do
      silent?(line, at_ms) ->
        {:error, :last_words}

      frozen?(line, at_ms) and frozen?(hear_answers(line), at_ms) ->
        {:error, :frozen}

      true ->
        if :counters.get(line.counters, @unanswered) == 0,
          do: :counters.put(line.counters, @unanswered_ms, at_ms)

        :counters.add(line.counters, @unanswered, 1)
        sign(line, ?K, [], at_ms)
    end
  end

  # What this process does after a silence it decided before; the program, which has said the last words, or will when
  # it reads this, would not write it.
  defp sign(line, letter, body, at_ms) do
    if silent?(line, at_ms) do
      {:error, :last_words}
    else
      :counters.put(line.counters, @life_ms, at_ms)
      command(line, [letter, <<at_ms::64>>, body])
    end
  end

  # As soon as the program may have said the last words, which it does at this very millisecond.
  defp silent?(%{counters: counters} = line, at_ms) do
    :counters.get(counters, @words) > 0 and
      at_ms - :counters.get(counters, @life_ms) >= line.keep_alive_ms
  end

  # A VM that was frozen itself has given few signs meanwhile.
  defp frozen?(%{counters: counters}, at_ms) do
    :counters.get(counters, @unanswered) >= @frozen_signs and
      at_ms - :counters.get(counters, @unanswered_ms) >= @frozen_ms
  end

  @impl Line
  def close(%__MODULE__{port: port} = line) do
    # A frozen program would not answer this either.
    if command(line, "C") == :ok and not frozen?(line, now_ms()), do: wait_closed(port)
    shut(port)
  end

  @impl Line
  def handle(%__MODULE__{port: port} = line, message) do
    case message do
      {^port, {:data, <<?D, bytes::binary>>}} ->
        take(line, byte_size(bytes))
        {:data, bytes}

      {^port, {:data, <<?T, size::32>>}} ->
        :counters.sub(line.counters, @under_way, size)
        :unknown

      {^port, {:data, "K"}} ->
        :counters.put(line.counters, @unanswered, 0)
        :unknown

      {^port, {:data, <<?E, reason::binary>>}} ->
        {:error, reason(reason)}

      {^port, {:exit_status, status}} ->
        {:error, {:exit, status}}

      {:EXIT, ^port, reason} ->
        {:error, {:exit, reason}}

      _other ->
        :unknown
    end
  end

  defp arguments(options) do
    the_end = if options[:port], do: ["--port", options[:port]], else: ["--pty", options[:pty]]

    the_end ++
      ["--speed", "#{options[:speed]}", "--keep-alive", "#{options[:keep_alive_ms]}"] ++
      ["--last-words", Base.encode16(options[:last_words])] ++ dtr(options[:dtr])
  end

  defp dtr(nil), do: []
  defp dtr(on?), do: ["--dtr", if(on?, do: "on", else: "off")]

  defp put(line, size, bytes) do
    with :ok <- sign(line, ?W, bytes, now_ms()),
         do: :counters.add(line.counters, @under_way, size)
  end

  defp fits?(line, size), do: :counters.get(line.counters, @under_way) + size <= @out_most

  # The owner may write much without reading its mailbox.
  defp hear_taken(%{port: port} = line) do
    receive do
      {^port, {:data, <<?T, size::32>>}} ->
        :counters.sub(line.counters, @under_way, size)
        hear_taken(line)
    after
      0 -> line
    end
  end

  defp hear_answers(%{port: port} = line) do
    receive do
      {^port, {:data, "K"}} ->
        :counters.put(line.counters, @unanswered, 0)
        hear_answers(line)
    after
      0 -> line
    end
  end

  defp same_clock(line, at_ms) do
    :counters.put(line.counters, @life_ms, at_ms)
    if abs(now_ms() - at_ms) <= @clocks_ms, do: {:ok, line}, else: give_up(line, :clock)
  end

  # CLOCK_MONOTONIC of the machine, as the program reads it; Erlang's own clocks are corrected.
  defp now_ms do
    source = :erlang.system_info(:os_monotonic_time_source)
    :erlang.convert_time_unit(source[:time], :native, :millisecond)
  end

  # A program that has stopped reading for lack of this resumes once the owner has taken what it
  # has.
  defp take(%{counters: counters} = line, size) do
    :counters.add(counters, @untold, size)
    taken = :counters.get(counters, @untold)

    if taken >= @take_step and command(line, <<?T, taken::32>>) == :ok,
      do: :counters.sub(counters, @untold, taken)
  end

  # Without `:nosuspend` a frozen program would suspend its owner.
  defp command(%{port: port}, packet) do
    if :erlang.port_command(port, packet, [:nosuspend]), do: :ok, else: {:error, :overrun}
  rescue
    # The port has ended; a message says why.
    ArgumentError -> {:error, :closed}
  end

  defp wait_closed(port) do
    receive do
      {^port, {:data, "C"}} -> :ok
      {^port, {:data, <<?E, _reason::binary>>}} -> :ok
      {^port, {:exit_status, _status}} -> :ok
      {:EXIT, ^port, _reason} -> :ok
    after
      @close_ms -> :ok
    end
  end

  defp give_up(line, reason) do
    shut(line.port)
    {:error, reason}
  end

  # Afterwards no message of the port is left.
  defp shut(port) do
    monitor = Port.monitor(port)
    Process.unlink(port)
    send(port, {self(), :close})

    receive do
      {:DOWN, ^monitor, :port, _port, _reason} -> forget(port)
    end
  end

  defp forget(port) do
    receive do
      {^port, _message} -> forget(port)
      {:EXIT, ^port, _reason} -> forget(port)
    after
      0 -> :ok
    end
  end

  defp reason(text), do: Map.get_lazy(@reasons, text, fn -> {:os, text} end)
end
