defmodule Hal.Serial.NativeTest do
  use ExUnit.Case, async: true
  import Hal.Lines
  alias Hal.Serial
  @moduletag :realtime

  @all :binary.list_to_bin(Enum.to_list(0..255))

  setup do
    Process.flag(:trap_exit, true)
    {:ok, link: Path.join(folder(), "line")}
  end

  defp pair(link, options \\ []) do
    far = far!(link)
    {:ok, near} = Serial.open(Keyword.merge([port: link, keep_alive_ms: 60_000], options))
    {near, far}
  end

  describe "bytes" do
    test "all values, both ways, and at any speed", %{link: link} do
      {near, far} = pair(link, speed: 123_457)
      :ok = Serial.write(near, [@all, [?a, "b"]])
      assert read(far, 258) == @all <> "ab"
      :ok = Serial.write(far, @all)
      assert read(near, 256) == @all
      :ok = Serial.write(far, "")
      assert Serial.handle(near, :other) == :unknown
      assert {Serial.close(near), Serial.close(far)} == {:ok, :ok}
      assert Process.info(self(), :messages) == {:messages, []}
      assert Serial.close(near) == :ok
      assert Serial.write(near, "x") == {:error, :closed}
    end

    # The line is kept full on both sides, in chunks of any size that fits.
    test "a megabyte both ways at once", %{link: link} do
      {near, far} = pair(link)
      [to_far, to_near] = for _ <- 1..2, do: random(1_000_000)
      sides = [{near, to_far, []}, {far, to_near, []}]
      [{_, "", from_far}, {_, "", from_near}] = exchange(sides, 2_000_000)
      assert IO.iodata_to_binary(from_far) == to_near
      assert IO.iodata_to_binary(from_near) == to_far
    end

    test "nobody waits: what does not fit is not written", %{link: link} do
      {near, far} = pair(link)
      assert Serial.write(near, random(4097)) == {:error, :overrun}
      kill(:STOP, os_pid(near))
      {sent, _} = fill(near)
      assert sent <= 4096
      kill(:CONT, os_pid(near))
      assert byte_size(read(far, sent)) == sent
      refute_more(far, near, "still good")
    end

    test "whoever does not look at what comes grows nothing", %{link: link} do
      {near, far} = pair(link)
      before = resident(near)
      # `far` writes until nothing moves any more; of `near` no message is looked at.
      total = flood(far, 0)
      {:messages, messages} = Process.info(self(), :messages)

      waiting =
        for {port, {:data, <<?D, bytes::binary>>}} <- messages, port == near.line.port, do: bytes

      assert IO.iodata_length(waiting) in 60_000..70_000
      assert total in 70_000..120_000
      # Its buffers are 84 kB, of which some were not used before.
      assert resident(near) - before < 100
      assert byte_size(read(near, total)) == total
    end
  end

  defp random(size), do: :rand.bytes(size)

  # Writes as long as there is room, then takes a message.
  defp exchange(sides, 0), do: sides

  defp exchange(sides, left) do
    sides = for {line, bytes, got} <- sides, do: {line, write_some(line, bytes), got}
    assert_receive message

    {sides, size} =
      Enum.map_reduce(sides, 0, fn {line, bytes, got}, size ->
        case Serial.handle(line, message) do
          {:data, more} -> {{line, bytes, [got, more]}, size + byte_size(more)}
          :unknown -> {{line, bytes, got}, size}
        end
      end)

    exchange(sides, left - size)
  end

  defp write_some(_line, ""), do: ""

  defp write_some(line, bytes) do
    size = min(:rand.uniform(2000), byte_size(bytes))
    {chunk, rest} = :erlang.split_binary(bytes, size)

    case Serial.write(line, chunk) do
      :ok -> write_some(line, rest)
      {:error, :overrun} -> bytes
    end
  end

  defp fill(line, sent \\ 0) do
    case Serial.write(line, random(100)) do
      :ok -> fill(line, sent + 100)
      error -> {sent, error}
    end
  end

  # Until half a second has brought no room.
  defp flood(%{line: %{port: port}} = line, total) do
    {sent, {:error, :overrun}} = fill(line)

    receive do
      {^port, _} = message -> Serial.handle(line, message)
    after
      500 -> nil
    end
    |> case do
      nil -> total + sent
      :unknown -> flood(line, total + sent)
    end
  end

  defp resident(line) do
    status = File.read!("/proc/#{os_pid(line)}/status")
    [_, kilobytes] = Regex.run(~r/VmRSS:\s+(\d+) kB/, status)
    String.to_integer(kilobytes)
  end

  describe "errors at opening" do
    test "no such device, not a serial device, busy", %{link: link} do
      File.write!(link <> "_file", "")
      assert Serial.open(port: link) == {:error, :enoent}
      assert Serial.open(port: link <> "_file/x") == {:error, :enoent}
      assert Serial.open(port: link <> "_file") == {:error, :enotty}
      assert Serial.open(port: Path.dirname(link)) == {:error, :enotty}
      assert Serial.open(port: "/dev/null") == {:error, :enotty}

      {near, _far} = pair(link)
      assert Serial.open(port: link) == {:error, :ebusy}
      :ok = Serial.close(near)
      assert {:ok, near} = Serial.open(port: link)
      kill(:KILL, os_pid(near))
      assert next(near) == {:error, {:exit, 137}}
      :ok = Serial.close(near)
      assert {:ok, _} = Serial.open(port: link)
      {:messages, messages} = Process.info(self(), :messages)
      assert messages == []
    end

    test "permission denied", %{link: link} do
      _far = far!(link)
      File.chmod!(link, 0o000)
      assert nobody_opens(link) == "eacces"
    end

    defp nobody_opens(link) do
      program = Path.join(Path.dirname(link), "serial")
      File.cp!(Application.app_dir(:hal, "priv/serial"), program)
      File.chmod!(Path.dirname(link), 0o755)
      {command, arguments} = as_nobody()
      arguments = arguments ++ [program, "--port", link]
      settings = [:binary, packet: 2, args: arguments]
      port = Port.open({:spawn_executable, System.find_executable(command)}, settings)
      assert_receive {^port, {:data, <<?E, reason::binary>>}}
      Port.close(port)
      reason
    end

    # Root may open everything; others need only take the right away.
    defp as_nobody do
      case {System.cmd("id", ["-u"]), System.find_executable("setpriv")} do
        {{"0\n", 0}, nil} -> flunk("as root this needs setpriv (util-linux)")
        {{"0\n", 0}, _} -> {"setpriv", ~w(--reuid 65534 --regid 65534 --clear-groups --)}
        _user -> {"env", []}
      end
    end
  end

  describe "a pseudo-terminal" do
    test "replaces only a link that leads nowhere, and is removed at the end", %{link: link} do
      File.write!(link, "precious")
      assert Serial.open(pty: link) == {:error, :eexist}
      assert File.read!(link) == "precious"

      File.ln_s!(link, link <> "_2")
      assert Serial.open(pty: link <> "_2") == {:error, :eexist}
      assert Serial.open(pty: Path.dirname(link)) == {:error, :eexist}
      assert Serial.open(pty: link <> "_no/x") == {:error, :enoent}

      File.rm!(link)
      File.ln_s!("/dev/pts/none", link)
      far = far!(link <> "_2")
      other = far!(link)
      :ok = Serial.close(other)
      assert {:ok, "/dev/pts/" <> _} = File.read_link(link <> "_2")
      :ok = Serial.close(far)
      assert File.lstat(link <> "_2") == {:error, :enoent}
    end

    test "leaves alone the link of who has got its number since", %{link: link} do
      for _ <- 1..5 do
        old = far!(link)
        program = os_pid(old)
        kill(:TERM, program)
        assert next(old) == {:error, :terminated}
        # The old program is still there; its pty is not.
        new = far!(link)
        :ok = Serial.close(old)
        ended!(program)
        assert {:ok, "/dev/pts/" <> _} = File.read_link(link)
        :ok = Serial.close(new)
      end
    end

    test "leaves a link alone that is no longer its own", %{link: link} do
      far = far!(link)
      pid = os_pid(far)
      File.rm!(link)
      File.ln_s!("/elsewhere", link)
      :ok = Serial.close(far)
      ended!(pid)
      assert File.read_link(link) == {:ok, "/elsewhere"}
    end

    test "goes on when its user comes and goes, who hears only what is said meanwhile", %{
      link: link
    } do
      far = far!(link)

      for k <- 1..20 do
        {:ok, near} = Serial.open(port: link, keep_alive_ms: 60_000)
        :ok = Serial.write(near, "here #{k}.")
        read_until(far, "here #{k}.")
        :ok = Serial.write(far, "hello #{k}.")
        assert read_until(near, "hello #{k}.") == "hello #{k}."
        :ok = Serial.write(far, "not read by anybody")
        :ok = Serial.close(near)
        :ok = Serial.write(far, random(1024))
        # It is gone before the next one comes.
        %{port: port} = far.line
        assert_receive {^port, {:data, <<?T, _::32>>}} = taken
        assert Serial.handle(far, taken) == :unknown
      end
    end
  end

  # Programs end a moment after their line is closed.
  defp ended!(pid), do: eventually(fn -> not File.exists?("/proc/#{pid}") end)

  describe "in motion" do
    test "unplugged and plugged in again", %{link: link} do
      for _ <- 1..5 do
        {near, far} = pair(link, last_words: "stop", keep_alive_ms: 60_000)
        :ok = Serial.write(near, "go")
        assert read(far, 2) == "go"
        kill(:KILL, os_pid(far))
        assert next(near) == {:error, :unplugged}
        assert Serial.write(near, "go") in [:ok, {:error, :closed}]
        assert Serial.close(near) == :ok
        assert next(far) == {:error, {:exit, 137}}
        :ok = Serial.close(far)
        # The link of the killed one leads nowhere, or to who has got its number since.
        File.rm!(link)
        assert Serial.open(port: link) == {:error, :enoent}
      end
    end
  end
end
