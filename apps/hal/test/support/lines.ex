defmodule Hal.Lines do
  @moduledoc "Serial lines in tests: a folder for their links, and what comes in."
  import ExUnit.Assertions
  alias Hal.Serial

  @doc "A folder of the test's own, which goes with it."
  def folder do
    name = "convoy_lines_#{System.pid()}_#{System.unique_integer([:positive])}"
    folder = Path.join(System.tmp_dir!(), name)
    File.mkdir_p!(folder)
    ExUnit.Callbacks.on_exit(fn -> File.rm_rf!(folder) end)
    folder
  end

  @doc """
  A new pseudo-terminal's far end. A line does not write what is older than its `keep_alive_ms`; here nothing is to
  be lost because the machine is busy.
  """
  def far!(link) do
    {:ok, far} = Serial.open(pty: link, keep_alive_ms: 60_000)
    far
  end

  @doc "The next `size` bytes."
  def read(line, size, had \\ <<>>) when byte_size(had) <= size do
    if byte_size(had) == size do
      had
    else
      assert {:data, bytes} = next(line)
      read(line, size, had <> bytes)
    end
  end

  @doc "What comes until it ends with `ending`."
  def read_until(line, ending, had \\ <<>>) do
    if String.ends_with?(had, ending) do
      had
    else
      assert {:data, bytes} = next(line)
      read_until(line, ending, had <> bytes)
    end
  end

  @doc "The next message of the line that says something."
  def next(%Serial{line: %{port: port}} = line) do
    message =
      receive do
        {^port, _} = message -> message
        {:EXIT, ^port, _} = message -> message
      after
        20_000 -> flunk("nothing came on #{line.name}")
      end

    with :unknown <- Serial.handle(line, message), do: next(line)
  end

  @doc "Nothing more has come by the time that `line` has answered to `probe`, sent from `other`."
  def refute_more(line, other, probe) do
    :ok = Serial.write(other, probe)
    assert read(line, byte_size(probe)) == probe
  end

  @doc "The process id of the port program."
  def os_pid(%Serial{line: %{port: port}}) do
    {:os_pid, pid} = Port.info(port, :os_pid)
    pid
  end

  @doc "Sends a signal to a process by its id."
  def kill(signal, pid), do: [] = :os.cmd(~c"kill -#{signal} #{pid}")

  @doc "Looks again until it is so, and returns what it saw. For what ends without telling: programs, links."
  def eventually(condition, left \\ 2_000) do
    seen = condition.()

    cond do
      seen -> seen
      left == 0 -> flunk("it did not come to pass")
      true -> receive(do: (:never -> :ok), after: (10 -> eventually(condition, left - 1)))
    end
  end
end
