defmodule Swarm.PresenceTest do
  @moduledoc "A robot that moves only while a person is heard, in real time."
  use Swarm.Case, async: false
  @moduletag :realtime
  @moduletag :capture_log
  alias Robot.{Board, Names}
  alias Swarm.Directory

  @seconds 0.6

  defp told(id, wanted?) do
    pid = Names.whereis(id, :drive)
    assert_receive {:drive, {:drive, %Twist{linear: v}}, ^pid} when is_float(v)
    wanted?.(v) || told(id, wanted?)
  end

  defp person,
    do: Task.async(fn -> 100 |> Stream.interval() |> Enum.each(fn _n -> Swarm.present() end) end)

  test "it refuses orders without a person, drives with one, and is held when none is heard" do
    id = robot(:attended, presence: @seconds)
    other = robot(:unattended)
    standing([id, other])
    eventually(fn -> Directory.attended() == [id] end)

    assert {:error, line} = Swarm.tell(id, "move:0.2:0")
    assert line =~ "attended moves only while a person's page, pad or bin/presence is heard"

    person = person()
    eventually(fn -> Swarm.tell(id, "move:0.2:0") == :ok end)
    told(id, &(&1 > 0.1))

    Task.shutdown(person, :brutal_kill)
    left_ms = Hal.Clock.now_ms()
    told(id, &(&1 == 0))
    # A word counts from when it was said, so not from much before it was the last.
    assert (Hal.Clock.now_ms() - left_ms) in 300..1_500
    eventually(fn -> Board.latched?(Board.find!(id)) and Board.latched?(Board.find!(other)) end)
    assert Swarm.status(id).estop

    # A reset moves nothing, and the next order needs a person again.
    eventually(fn -> Swarm.reset() == :ok end)
    assert {:error, line} = Swarm.tell(id, "move:0.2:0")
    assert line =~ "none has been for 0.6 s"
    eventually(fn -> Swarm.tell(other, "move:0.2:0") == :ok end)
  end

  test "a word that was said long ago does not count" do
    id = robot(:late_word, presence: @seconds)
    standing([id])
    eventually(fn -> Directory.attended() == [id] end)
    long_ago = System.monotonic_time(:microsecond) - 700_000
    assert {:error, line} = Swarm.given(long_ago, &Swarm.present/0)
    assert line =~ "too late" or line =~ "ago"
    assert {:error, _needs_a_person} = Swarm.tell(id, "move:0.2:0")
  end
end
