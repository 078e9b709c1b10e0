defmodule Bench.StopTest do
  use ExUnit.Case, async: false
  alias Bench.Stop
  alias Bench.Stop.Reader
  alias Hal.RFlex.Protocol.Command
  @moduletag :realtime
  doctest Bench.Stop
  doctest Bench.Stop.Reader
  doctest Bench.Stop.Report

  @moduletag :tmp_dir

  # Wherever a stream is cut, it says the same.
  defp feed(bytes, size) do
    whole = div(byte_size(bytes), size)
    chunks = for n <- 0..(whole - 1)//1, do: binary_part(bytes, n * size, size)
    rest = binary_part(bytes, byte_size(bytes), -rem(byte_size(bytes), size))

    {events, _reader} = Enum.flat_map_reduce(chunks ++ [rest], Reader.new(), &Reader.feed(&2, &1))

    events
  end

  test "reads what the driver says, however it is cut, among noise and damaged frames" do
    damaged = :binary.replace(Command.move(4_711, 100), <<0x67>>, <<0x68>>)
    assert damaged != Command.move(4_711, 100)

    stream =
      [
        "noise",
        Command.brake(),
        Command.move(4_711, 100),
        <<0x1B>>,
        damaged,
        Command.turn(-300, 100),
        <<0x1B, 2, 2, 0, 7>>,
        Command.move(0, 100),
        Command.turn(0),
        <<0x1B, 2>>
      ]
      |> IO.iodata_to_binary()

    expected = [{:speed, 0, 4_711}, {:speed, 1, -300}, {:speed, 0, 0}, {:speed, 1, 0}]
    for size <- 1..40, do: assert(feed(stream, size) == expected)
  end

  test "no bytes make the reader crash, or keep more than a frame" do
    :rand.seed(:exsss, {1, 2, 3})

    Enum.reduce(1..5_000, Reader.new(), fn _, reader ->
      bytes = for _ <- 1..:rand.uniform(40), into: <<>>, do: <<Enum.random([0x1B, 2, 3, 7, 255])>>
      {_events, reader} = Reader.feed(reader, bytes)
      assert byte_size(reader) < 6 + 255 + 3
      reader
    end)
  end

  test "the table shows what did not come, what is too late, and what rolled again" do
    [crash, frozen, kill | _] = Stop.cases()
    pull = List.last(Stop.cases())

    text =
      Stop.Report.draw([
        %{case: crash, times: [13_000, 15_000, 14_000], rolled: 0, known: []},
        %{case: frozen, times: [200_000, 301_000], rolled: 1, known: []},
        %{case: kill, times: [5_000, nil], rolled: 0, known: []},
        %{case: pull, times: [100_000], rolled: 0, known: [600]}
      ])

    assert text =~ "| a behaviour raises | 14.0 ms | 15.0 ms | 300 ms | yes | 3 | never |"
    assert text =~ "| 301.0 ms | 300 ms | **no** | 2 | **1 times** |"
    assert text =~ "| 5.0 ms | **none came** | 300 ms | **no** | 2 | never |"
    assert text =~ "| 100.0 ms | 100.0 ms | – | – | 1 | never |"
    assert text =~ "after 0.6 ms"
  end

  # How fast it stops is for the benchmark to measure, on a machine with nothing else to do.
  test "a robot on a real line is stopped in every case", %{tmp_dir: folder} do
    {:ok, cases} = Stop.choose("crash,frozen,kill,freeze,estop,bumper,pull")

    for result <- Stop.Runner.run(cases, 1, folder, fn _note -> :ok end) do
      assert [us] = result.times
      assert is_integer(us), "#{result.case.name}: no stop came"
      assert result.rolled == 0, "#{result.case.name}: it rolled again"
    end
  end
end
