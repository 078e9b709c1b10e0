defmodule Console.Terminal.Tty do
  @moduledoc false
  # Puts the terminal into raw mode: single keys instead of lines, and its settings restored at the end.
  #
  # Ctrl-C comes as a key too: it must not stop the program while the terminal is changed.

  @raw ~w(-icanon -echo -isig -ixon min 1 time 0)

  @type saved :: {device :: String.t(), settings :: String.t()}

  @doc "Switches to single keys; `:error` if standard input and output are not a terminal, or one that cannot draw (`TERM=dumb`)."
  @spec open() :: {:ok, saved()} | :error
  def open do
    # Asking for the columns would not tell, because a terminal may not know its size.
    with true <- System.get_env("TERM") != "dumb",
         {:ok, device} <- terminal("/proc/self/fd/0"),
         {:ok, _device} <- terminal("/proc/self/fd/1"),
         {:ok, settings} <- stty(device, ["-g"]),
         {:ok, _nothing} <- stty(device, @raw) do
      {:ok, {device, settings}}
    else
      _no_terminal -> :error
    end
  end

  @doc "Restores the terminal."
  @spec close(saved()) :: :ok
  def close({device, settings}) do
    _ = stty(device, [settings])
    :ok
  end

  @doc "Columns and rows."
  @spec size() :: {pos_integer(), pos_integer()}
  def size do
    case {:io.columns(:standard_io), :io.rows(:standard_io)} do
      {{:ok, columns}, {:ok, rows}} when columns > 0 and rows > 0 -> {columns, rows}
      _none -> {80, 24}
    end
  end

  defp terminal(descriptor) do
    case File.read_link(descriptor) do
      {:ok, "/dev/null"} -> :error
      {:ok, "/dev/" <> _ = device} -> {:ok, device}
      _pipe_or_file_or_unknown -> :error
    end
  end

  # Programs that the VM starts have no terminal of their own, so they get ours by name.
  defp stty(device, arguments) do
    case System.cmd("stty", ["-F", device | arguments], stderr_to_stdout: true) do
      {text, 0} -> {:ok, String.trim(text)}
      {_text, _status} -> :error
    end
  end
end
