defmodule Swarm.EntryTest do
  use ExUnit.Case, async: false
  alias Swarm.{Directory, Entry}

  defp group, do: {:team, :"entry_#{System.unique_integer([:positive])}"}

  # As after the directory has ended: the message that it sends, and what a timer says later.
  defp down(entry), do: {:DOWN, entry.scope, :process, {Directory, node()}, :killed}

  test "enters, enters again when the directory has ended, and leaves for good" do
    group = group()
    entry = Entry.enter([group])
    assert Entry.in?(entry)
    assert Directory.members(group) == [self()]

    {:ok, out} = Entry.arrived(entry, down(entry))
    refute Entry.in?(out)
    timer = Entry.timer(out)
    assert_receive ^timer
    {:ok, again} = Entry.arrived(out, timer)
    assert Entry.in?(again)

    left = Entry.leave(again)
    assert Directory.members(group) -- [self()] == []
    refute Entry.in?(left)
    assert Entry.leave(left) == left
    # A timer that was under way brings nobody back.
    assert Entry.arrived(left, timer) == {:ok, left}
    refute Entry.in?(left)
  end

  test "each of several entries knows its own messages, and starts one timer for each end" do
    [one, two] = for _ <- 1..2, do: Entry.enter([group()])
    assert Entry.arrived(one, down(two)) == :other
    {:ok, out} = Entry.arrived(one, down(one))
    assert Entry.arrived(two, Entry.timer(out)) == :other
    # Not the end of anything that is watched, though it looks so to one that watches nothing.
    assert Entry.arrived(out, {:DOWN, nil, :process, self(), :killed}) == :other
    assert Entry.arrived(out, :junk) == :other
  end
end
