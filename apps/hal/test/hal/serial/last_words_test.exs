defmodule Hal.Serial.LastWordsTest do
  use ExUnit.Case, async: true
  import Hal.Lines
  alias Hal.{LineHolder, Serial}
  @moduletag :realtime

  @stop "\eSTOP\r"

  setup do
    Process.flag(:trap_exit, true)
    link = Path.join(folder(), "line")
    far = far!(link)
    {:ok, link: link, far: far}
  end

  defp open(link, options \\ []) do
    defaults = [port: link, last_words: @stop, keep_alive_ms: 60_000]
    {:ok, near} = Serial.open(Keyword.merge(defaults, options))
    near
  end

  # A process of its own that holds the line, and dies when it is told to.
  defp holder(link, options \\ []) do
    me = self()

    pid =
      spawn(fn ->
        near = open(link, options)
        send(me, {:near, near})
        receive do: (:end -> :ok)
      end)

    assert_receive {:near, near}
    {pid, near}
  end

  test "at closing, behind what was written before", %{link: link, far: far} do
    near = open(link)
    for k <- 1..100, do: :ok = Serial.write(near, "packet #{k}\r")
    :ok = Serial.close(near)
    said = read_until(far, @stop)
    assert said == Enum.map_join(1..100, &"packet #{&1}\r") <> @stop
  end

  test "when the process ends, in whatever way", %{link: link, far: far} do
    for way <- [:end, :kill] do
      {pid, _near} = holder(link)
      if way == :end, do: send(pid, :end), else: Process.exit(pid, :kill)
      assert read_until(far, @stop) == @stop
    end
  end

  test "other ones, longer ones, none, and too long ones", %{link: link, far: far} do
    near = open(link)
    words = :rand.bytes(1024)
    :ok = Serial.last_words(near, words)
    assert Serial.last_words(near, words <> "x") == {:error, :einval}
    :ok = Serial.close(near)
    assert read(far, 1024) == words

    near = open(link, last_words: words)
    :ok = Serial.close(near)
    assert read(far, 1024) == words

    near = open(link)
    :ok = Serial.last_words(near, "")
    :ok = Serial.close(near)
    near = open(link, last_words: "")
    refute_more(far, near, "nothing said before this")
  end

  test "in silence once; then the line is lost, whatever its owner says", %{link: link, far: far} do
    near = open(link, keep_alive_ms: 50)
    assert read(far, 6) == @stop

    for life <- [&Serial.keep_alive/1, &Serial.write(&1, "go"), &Serial.last_words(&1, @stop)],
        do: assert(life.(near) == {:error, :last_words})

    assert next(near) == {:error, :last_words}
    :ok = Serial.close(near)
    # At the closing, and nothing before that.
    assert read(far, 6) == @stop
    {:ok, again} = Serial.open(port: link)
    refute_more(far, again, "nothing else")
  end

  test "in silence, which a line that has none outlives", %{link: link, far: far} do
    near = open(link, last_words: "", keep_alive_ms: 50)
    receive(do: (:never -> :ok), after: (150 -> :ok))
    assert Serial.keep_alive(near) == :ok
    :ok = Serial.last_words(near, @stop)
    assert next(near) == {:error, :last_words}
    assert read(far, 6) == @stop
  end

  test "though what was written before a silence still waits in the pipe", %{link: link, far: far} do
    near = open(link, keep_alive_ms: 200)
    program = os_pid(near)
    kill(:STOP, program)
    eventually(fn -> File.read!("/proc/#{program}/stat") =~ ") T " end)
    :ok = Serial.write(near, "old speed\r")
    receive(do: (:never -> :ok), after: (300 -> :ok))
    # As from a VM that thaws before its program does, and knows nothing of it.
    :counters.put(near.line.counters, 6, 0)
    :ok = Serial.write(near, "late speed\r")
    kill(:CONT, program)
    assert read(far, 6) == @stop
    assert next(near) == {:error, :last_words}
    :ok = Serial.close(near)
    {:ok, again} = Serial.open(port: link)
    assert read(far, 6) == @stop
    refute_more(far, again, "nothing else")
  end

  test "not while there are signs of life", %{link: link, far: far} do
    near = open(link, keep_alive_ms: 400)
    {:ok, timer} = :timer.send_interval(20, :tick)

    for k <- 1..40 do
      assert_receive :tick
      :ok = if rem(k, 2) == 0, do: Serial.keep_alive(near), else: Serial.write(near, ".")
    end

    :timer.cancel(timer)
    assert read_until(far, @stop) == String.duplicate(".", 20) <> @stop
  end

  test "ahead of what a full line has not taken", %{link: link, far: far} do
    {pid, near} = holder(link)
    sent = fill(near, 0)
    program = os_pid(near)
    Process.exit(pid, :kill)
    # Nobody reads before that, or there would be room for all.
    eventually(fn -> not File.exists?("/proc/#{program}") end)
    said = read_until(far, @stop)
    # What the kernel and the port program held is gone, and what was there before is whole.
    assert byte_size(said) < sent
    assert said == :binary.copy("x", byte_size(said) - 6) <> @stop
  end

  # Nobody looks at what comes at the far end, until nothing moves any more.
  defp fill(near, sent, still \\ 0) do
    case Serial.write(near, :binary.copy("x", 512)) do
      :ok ->
        fill(near, sent + 512)

      {:error, :overrun} when still == 20 ->
        sent

      {:error, :overrun} ->
        # What the line took is told to the holder, which does not look either.
        {:messages, messages} = Process.info(near_owner(near), :messages)
        taken = for {_, {:data, <<?T, size::32>>}} <- messages, do: size
        :counters.put(near.line.counters, 1, sent - Enum.sum(taken))
        receive do: (:never -> :ok), after: (10 -> fill(near, sent, still + 1))
    end
  end

  defp near_owner(near), do: near.line.port |> Port.info(:connected) |> elem(1)

  test "when the port program is told to end, which its owner hears", %{link: link, far: far} do
    for signal <- [:TERM, :HUP] do
      near = open(link)
      kill(signal, os_pid(near))
      assert read_until(far, @stop) == @stop
      assert next(near) == {:error, :terminated}
      :ok = Serial.close(near)
    end
  end

  test "not for other signals", %{link: link, far: far} do
    near = open(link)
    kill(:INT, os_pid(near))
    kill(:PIPE, os_pid(near))
    refute_more(far, near, "still here")
  end

  describe "of a VM" do
    test "that is killed", %{link: link, far: far} do
      os_pid = start_vm(port: link, last_words: @stop, keep_alive_ms: 60_000)
      # Long before the program would have missed a keep-alive.
      kill_and_hear(:KILL, os_pid, far)
      # The line is free for the next one, once the program has ended too.
      eventually(fn -> match?({:ok, _}, Serial.open(port: link)) end)
    end

    test "that is frozen, and comes back: it opens its line anew", %{link: link, far: far} do
      os_pid = start_vm(port: link, last_words: @stop)
      :ok = Serial.write(far, "?")
      assert read(far, 1) == "!"
      # Heard while it is frozen.
      kill_and_hear(:STOP, os_pid, far)
      :ok = Serial.write(far, "?")
      kill(:CONT, os_pid)
      # It answers by the old line, which says only the last words, at its closing.
      assert read(far, 6) == @stop
      eventually(fn -> answers?(far) end)
      kill_and_hear(:STOP, os_pid, far)
      kill(:CONT, os_pid)
    end

    test "that is frozen while much comes from the line", %{link: link, far: far} do
      os_pid = start_vm(port: link, last_words: @stop)
      kill(:STOP, os_pid)
      assert flood_until(far, "") == @stop
      kill(:CONT, os_pid)
    end
  end

  # What is said before the line is open nobody hears.
  defp answers?(%{line: %{port: port}} = far) do
    :ok = Serial.write(far, "?")

    receive do
      {^port, {:data, <<?D, bytes::binary>>}} = message ->
        assert {bytes, Serial.handle(far, message)} == {"!", {:data, "!"}}
    after
      50 -> false
    end
  end

  defp start_vm(options), do: LineHolder.start(options).pid

  defp kill_and_hear(signal, os_pid, far) do
    kill(signal, os_pid)
    assert read_until(far, @stop) == @stop
  end

  defp flood_until(_far, @stop), do: @stop

  defp flood_until(%{line: %{port: port}} = far, had) do
    _full_or_not = Serial.write(far, :rand.bytes(1000))

    receive do
      {^port, _} = message ->
        case Serial.handle(far, message) do
          {:data, bytes} -> flood_until(far, had <> bytes)
          :unknown -> flood_until(far, had)
        end
    after
      0 -> flood_until(far, had)
    end
  end
end
