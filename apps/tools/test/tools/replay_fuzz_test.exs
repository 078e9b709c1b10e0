defmodule Tools.ReplayFuzzTest do
  @moduledoc """
  Recordings whose checksums are right, and whose content is not: each ends in a line, or replays. What differs is drawn
  by the seed of the tests.
  """
  # What is written to standard error by others would be heard, too.
  use ExUnit.Case, async: false
  import ExUnit.CaptureIO
  alias Console.{Demo, Live, Runs}
  alias Tools.Replay
  alias Mcap.{Reader, Writer}
  @moduletag :tmp_dir
  @moduletag :capture_log

  @ours "/convoy/"

  # Of a run in lockstep and of live robots: what has been recorded, as `messages/1` returns it.
  setup %{tmp_dir: folder} do
    [run, live] = for name <- ["run.mcap", "live.mcap"], do: Path.join(folder, name)
    ticks = Runs.options("--headless --blobs direct --robots 3 --duration 6 --record", [run])
    {_status, _text} = with_io(fn -> Demo.run(ticks, Lab.Trial) end)
    alive = Runs.options("--headless --hardware 1 --robots 2 --duration 2 --record", [live])
    stop = [stop: &Lab.Fleet.stop/1]
    play = fn -> Live.Recording.run(alive, &Demo.run(&1, Lab.Fleet, stop)) end
    capture_io(:stderr, fn -> with_io(play) end)
    {:ok, path: Path.join(folder, "fuzz.mcap"), recorded: Enum.map([run, live], &messages/1)}
  end

  # All messages of our topics.
  defp messages(path) do
    {:ok, reader} = Reader.open(path)

    for {@ours <> _ = topic, channel, ns, data} <- Enum.to_list(Reader.messages(reader)),
        do: {topic, channel.message_encoding, ns, :binary.copy(data)}
  end

  defp write(path, messages) do
    {writer, head} = Writer.new(chunk_bytes: 100_000)

    {writer, written} =
      Enum.reduce(messages, {writer, [head]}, fn {topic, encoding, ns, data}, {writer, written} ->
        {id, writer} = Writer.channel(writer, topic, encoding, nil, %{})
        {writer, more} = Writer.message(writer, id, ns, data)
        {writer, [written | more]}
      end)

    File.write!(path, [written | Writer.finish(writer)])
  end

  defp replay(path, words) do
    {:ok, options} = Replay.Options.parse([path | words])
    test = self()

    run = fn ->
      send(test, {:ran, with_io("why\nnext\nshow\n", fn -> Replay.run(options) end)})
    end

    errors = capture_io(:stderr, run)
    assert_received {:ran, {status, text}}
    {status, text, errors}
  end

  defp mutate(messages) do
    at = Enum.random(0..(length(messages) - 1))

    case Enum.random(1..10) do
      1 -> List.delete_at(messages, at)
      2 -> List.update_at(messages, at, fn {t, e, _ns, data} -> {t, e, time(), data} end)
      3 -> List.update_at(messages, at, fn {t, e, ns, data} -> {t, e, ns, flipped(data)} end)
      _more -> List.update_at(messages, at, fn {t, e, ns, data} -> {t, e, ns, changed(data)} end)
    end
  end

  defp time, do: Enum.random([0, 1, 2 ** 62, 2 ** 64 - 1, :rand.uniform(10_000_000_000)])

  defp flipped(data) do
    at = :rand.uniform(byte_size(data)) - 1
    <<head::binary-size(at), byte, tail::binary>> = data
    <<head::binary, Bitwise.bxor(byte, :rand.uniform(255)), tail::binary>>
  end

  defp changed(data) do
    term = :erlang.binary_to_term(data)
    :erlang.term_to_binary(change(term), Enum.random([[], [:compressed]]))
  rescue
    # It was flipped before.
    ArgumentError -> data
  end

  # A part of it, anywhere, is something else.
  defp change([_ | _] = list) do
    at = Enum.random(0..length(list))
    if at == 0, do: strange(), else: List.update_at(list, at - 1, &change/1)
  rescue
    # An improper list.
    ArgumentError -> strange()
  end

  defp change(tuple) when is_tuple(tuple) and tuple_size(tuple) > 0,
    do: tuple |> Tuple.to_list() |> changed_at() |> List.to_tuple()

  defp change(map) when is_map(map) and map_size(map) > 0 do
    {key, value} = map |> Map.to_list() |> Enum.random()
    Map.put(map, key, change(value))
  end

  defp change(_other), do: strange()

  defp changed_at(parts),
    do: List.update_at(parts, Enum.random(0..(length(parts) - 1)), &change/1)

  defp strange do
    Enum.random([
      nil,
      :all,
      :mag1,
      [],
      [[] | :improper],
      {},
      %{},
      "",
      String.duplicate("long ", 10_000),
      <<255, 254>>,
      0,
      -1,
      1.0e308,
      -1.0e-308,
      2 ** 200,
      -(2 ** 62),
      1_000_000_000_000,
      Enum.to_list(1..10_000),
      List.duplicate([], 1_000),
      %Hal.Pose{x: 1.0e300, y: 0.0, heading: 1.0e300},
      %Hal.Twist{linear: 1.0e300, turn: -1.0e300},
      {:tick, 1.0e30},
      {:reading, {:sonar, :none}, 100}
    ])
  end

  # None ends in a trace, and each in bounded time.
  defp fuzz(recorded, path, count) do
    for n <- 1..count, messages <- [Enum.random(recorded)] do
      write(path, Enum.reduce(1..Enum.random(1..3), messages, fn _n, some -> mutate(some) end))

      words =
        Enum.random([[], [], [], ["--at", "1", "--why", "mag1"], ["--step"], ["--until", "1"]])

      {us, {status, text, errors}} = :timer.tc(fn -> replay(path, words) end)
      case = {n, words, status, errors, String.slice(text, 0, 300)}
      assert {case, status in 0..2} == {case, true}

      assert {case, length(String.split(errors, "\n", trim: true))} ==
               {case, if(status == 1, do: 1, else: 0)}

      assert {case, errors == "" or String.starts_with?(errors, "replay: ")} == {case, true}
      assert {case, byte_size(errors) < 600} == {case, true}
      {us, status, errors}
    end
  end

  # What the VM has at most while a function runs, above what it had before.
  defp memory(function) do
    before = :erlang.memory(:total)
    test = self()
    meter = spawn_link(fn -> measure(before, test) end)
    result = function.()
    send(meter, :done)
    assert_receive {:most, most}
    {result, most - before}
  end

  defp measure(most, test) do
    receive do
      :done -> send(test, {:most, most})
    after
      5 -> measure(max(most, :erlang.memory(:total)), test)
    end
  end

  # An empty list of one byte takes sixteen in memory, and nothing when it is compressed.
  defp bomb(count) do
    nils = [<<108, count::32>>, :binary.copy(<<106>>, count + 1)]
    <<131, 80, count + 6::32, IO.iodata_to_binary(:zlib.compress(nils))::binary>>
  end

  test "a message of 250 kB that would take 4 GB ends in a line, and takes a sixth at most",
       %{recorded: recorded, path: path} do
    bomb = bomb(250_000_000)
    assert byte_size(bomb) < 260_000

    for messages <- recorded, at <- [0, div(length(messages), 2)] do
      write(path, List.update_at(messages, at, fn {t, e, ns, _data} -> {t, e, ns, bomb} end))
      {{status, _text, errors}, most} = memory(fn -> replay(path, []) end)
      assert {status, most < 700_000_000} == {1, true}

      assert errors =~
               ~r/^replay: #{path} [^\n]* that this( version of the)? program did not record\n$/
    end
  end

  @tag timeout: 300_000
  test "a tick of another time, one in a century, and one on which a robot fails end in a line",
       %{
         recorded: [ticks, _live],
         path: path
       } do
    century = 3_000_000_000_000
    late = fn {_at_ms, packed} -> {century, packed} end

    strange = fn {at_ms, {told, _entries}} ->
      {at_ms,
       {told,
        [{0, :mag1, {:reading, {:odometry, %{pose: :here}}, at_ms}, []}, {4, :mag1, at_ms, []}]}}
    end

    for {change, time, why} <- [
          {late, nil, "has a tick of the wrong time"},
          {late, century * 1_000_000,
           "has something that this program did not record, and that takes too long"},
          {strange, nil,
           "has something that this program did not record, and that cannot be replayed ("}
        ] do
      {before, [{topic, encoding, ns, data} | _rest]} = Enum.split(ticks, 20)
      data = data |> :erlang.binary_to_term() |> change.() |> :erlang.term_to_binary()
      write(path, before ++ [{topic, encoding, time || ns, data}])
      assert {1, _text, errors} = replay(path, [])
      assert [line] = String.split(errors, "\n", trim: true)
      assert String.starts_with?(line, "replay: #{path} #{why}")
    end
  end

  @tag timeout: 300_000
  test "60 of them", %{recorded: recorded, path: path} do
    assert Enum.any?(fuzz(recorded, path, 60), fn {_us, status, _errors} -> status == 1 end)
  end

  @tag :long
  @tag timeout: 1_800_000
  test "500 of them", %{recorded: recorded, path: path} do
    told = fuzz(recorded, path, 500)
    assert Enum.any?(told, fn {_us, status, _errors} -> status == 1 end)
  end
end
