defmodule Swarm.Directory.MembershipTest do
  use ExUnit.Case, async: false
  alias Swarm.Directory

  defp group, do: {:team, :"entry_#{System.unique_integer([:positive])}"}

  # As after the end of the directory: the message that it sends, and that of a timer later.
  defp down(entry), do: {:DOWN, entry.scope, :process, {Directory, node()}, :killed}

  test "enters, enters again when the directory has ended, and leaves for good" do
    group = group()
    entry = Directory.Membership.enter([group])
    assert Directory.Membership.in?(entry)
    assert Directory.members(group) == [self()]

    {:ok, out} = Directory.Membership.arrived(entry, down(entry))
    refute Directory.Membership.in?(out)
    timer = Directory.Membership.timer(out)
    assert_receive ^timer
    {:ok, again} = Directory.Membership.arrived(out, timer)
    assert Directory.Membership.in?(again)

    left = Directory.Membership.leave(again)
    assert Directory.members(group) -- [self()] == []
    refute Directory.Membership.in?(left)
    assert Directory.Membership.leave(left) == left
    # A timer that was under way does not enter it again.
    assert Directory.Membership.arrived(left, timer) == {:ok, left}
    refute Directory.Membership.in?(left)
  end

  test "each of several entries knows its own messages, and starts one timer for each end" do
    [one, two] = for _ <- 1..2, do: Directory.Membership.enter([group()])
    assert Directory.Membership.arrived(one, down(two)) == :other
    {:ok, out} = Directory.Membership.arrived(one, down(one))
    assert Directory.Membership.arrived(two, Directory.Membership.timer(out)) == :other
    # This is not the end of anything monitored, although it looks so to an entry without a
    # monitor.
    assert Directory.Membership.arrived(out, {:DOWN, nil, :process, self(), :killed}) == :other
    assert Directory.Membership.arrived(out, :junk) == :other
  end

  test "a directory that ends while it is asked is down" do
    scope = Process.whereis(Directory)
    :ok = :sys.suspend(scope)

    asked =
      for function <- [:enter, :leave],
          do: spawn_monitor(fn -> exit(apply(Directory, function, [self(), [group()]])) end)

    asked? = fn -> elem(Process.info(scope, :message_queue_len), 1) >= 2 end
    assert Swarm.Case.eventually(asked?)

    Process.exit(scope, :kill)
    for {pid, ref} <- asked, do: assert_receive({:DOWN, ^ref, :process, ^pid, {:error, :down}})
    assert Swarm.Case.eventually(fn -> Process.whereis(Directory) end)
  end
end
