defmodule Lab.MessagesTest do
  use ExUnit.Case, async: true
  alias Lab.{Messages, Trial}
  alias Robot.Mission.Letter
  alias Swarm.Message
  doctest Messages

  defp letter(point),
    do: %Letter{to: :all, mission: Some.Mission, version: 1, kind: :seen, fields: [point: point]}

  test "the newest are kept, in their order, and numbered; heartbeats are none of them" do
    sent = for point <- 1..1_700, do: {:mag1, [:mag2], Message.of(:mag1, letter(point))}
    messages = Messages.note(%Messages{}, 100, sent)
    assert map_size(messages.rows) < 1_000
    assert map_size(messages.newest) == map_size(messages.rows)
    list = Messages.list(messages)
    assert Enum.map(list, & &1.n) == Enum.to_list(1_201..1_700)
    assert %{from: :mag1, to: [:mag2], text: "seen, point 1700"} = List.last(list)

    beat = Message.new(:mag1, :heartbeat, :not_looked_at)
    relay = Message.new(:mag2, :relay, %{beat | hops: 1})
    assert Messages.note(messages, 200, [{:mag1, :all, beat}, {:mag2, :all, relay}]) == messages
  end

  test "what is said again is in the row of what was said before, unless that was long ago" do
    say = &{&1, :all, Message.of(&1, letter(1))}

    list =
      %Messages{}
      |> Messages.note(1_000, [say.(:mag1), say.(:mag2)])
      |> Messages.note(3_000, [say.(:mag1)])
      |> Messages.note(6_000, [say.(:mag1)])
      |> Messages.list()

    assert for(row <- list, do: {row.n, row.from, row.at_s, row.last_s, row.count}) == [
             {2, :mag2, 1.0, 1.0, 1},
             {1, :mag1, 1.0, 3.0, 2},
             {4, :mag1, 6.0, 6.0, 1}
           ]
  end

  test "a run in lockstep sends what its recording has: letters of a round, in words" do
    options = %{robots: [:mag1, :mag2, :min1], blobs: :direct, seed: 4, duration_s: 60}
    {:ok, setup} = Trial.setup(options)
    trial = Trial.begin(setup, record: true)

    {_trial, messages} =
      Enum.reduce(1..200, {trial, %Messages{}}, fn _step, {trial, messages} ->
        {entries, trial} = trial |> Trial.step() |> Trial.take_entries()
        {trial, Messages.note(messages, trial.at_ms, Messages.of_entries(entries))}
      end)

    said = Messages.list(messages)
    assert said != []

    assert Enum.any?(
             said,
             &(&1.kind == :round and &1.text =~ ~r/^search \d+\.\d+ of \w+, 3 robots: /)
           )

    refute Enum.any?(said, &(&1.kind == :heartbeat))
    assert Enum.sort_by(said, & &1.last_s) == said
  end
end
