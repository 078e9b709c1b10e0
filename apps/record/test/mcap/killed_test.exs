defmodule Mcap.KilledTest do
  @moduledoc "A process of the operating system that records is killed: what it had flushed is read."
  use ExUnit.Case, async: true
  alias Mcap.{EndlessRecorder, Reader}

  @moduletag :tmp_dir
  @moduletag :realtime

  # Kills it when it has said this many lines, and returns how many messages it said that it had flushed.
  defp flushed_before_kill(path, lines) do
    main = ["-noshell", "-eval", "'Elixir.Mcap.EndlessRecorder':main().", "-extra", path]
    {:ok, port, pid} = Vm.open(main, [])
    said = listen(port, "", lines)
    :ok = Vm.signal("#{pid}", "KILL")
    said |> rest(port) |> String.split("\n") |> Enum.flat_map(&flushed/1) |> List.last()
  end

  # The last line may have been cut, too.
  defp flushed("flushed " <> digits) do
    case Integer.parse(digits) do
      {n, ""} when rem(n, 200) == 0 -> [n]
      _cut -> []
    end
  end

  defp flushed(""), do: []

  defp listen(port, said, lines) do
    if length(String.split(said, "\n")) > lines do
      said
    else
      assert_receive {^port, {:data, more}}, 60_000
      listen(port, said <> more, lines)
    end
  end

  defp rest(said, port) do
    receive do
      {^port, {:data, more}} -> rest(said <> more, port)
      {^port, {:exit_status, _status}} -> said
    after
      60_000 -> flunk("it was not killed")
    end
  end

  defp check(dir, lines) do
    path = Path.join(dir, "run-#{lines}.mcap")
    flushed = flushed_before_kill(path, lines)
    {:ok, t} = Reader.open(path)
    messages = for {"/n", _channel, ns, data} <- Reader.messages(t), do: {ns, data}
    count = length(messages)
    assert count >= flushed and flushed >= 200 * lines
    assert messages == for(n <- 1..count, do: {n * 1_000_000, EndlessRecorder.payload(n)})
    summary = Reader.summary(t)
    assert %{whole?: false, count: ^count} = summary
    # Where the next message would have begun, or where the file ends between two chunks.
    assert summary.cut_at in 1..summary.bytes
    File.rm!(path)
    summary.cut_at < summary.bytes
  end

  test "at some moments", %{tmp_dir: dir} do
    for lines <- [1, 7, 31], do: check(dir, lines)
  end

  @tag long: true, realtime: :long
  test "at 50 moments", %{tmp_dir: dir} do
    {moments, _state} = Enum.map_reduce(1..50, :rand.seed_s(:exsss, 1), &draw/2)
    for lines <- moments, do: check(dir, lines)
  end

  defp draw(_n, state), do: :rand.uniform_s(200, state)
end
