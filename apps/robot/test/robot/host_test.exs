defmodule Robot.HostTest do
  @moduledoc "What a role does not know changes nothing, and is counted."
  use Robot.Case, async: true
  @moduletag :realtime

  @roles [:gate, :executive, :pilot]

  test "unknown calls, casts and messages end no role, and are told at most once a minute" do
    id = robot(:host1)
    before = parts(id, @roles)
    test = self()

    told = fn _event, %{count: count}, %{robot: robot, role: role}, _config ->
      if robot == id, do: send(test, {:dropped, role, count})
    end

    :ok = Hal.Event.attach({__MODULE__, id}, [:robot, :role, :dropped], told, nil)
    on_exit(fn -> Hal.Event.detach({__MODULE__, id}) end)

    for role <- @roles do
      pid = Names.whereis(id, role)

      for term <- [:junk, {:junk, 1}, [1 | 2], %{}] do
        send(pid, term)
        GenServer.cast(pid, term)
        send(pid, {:"$gen_call", {test, make_ref()}, term})
      end

      assert %{dropped: {12, _due_ms}} = data(:sys.get_state(pid))
      assert_received {:dropped, ^role, 1}
      refute_received {:dropped, ^role, _count}
    end

    assert parts(id, @roles) == before
  end

  defp data({_phase, s}), do: s
  defp data(s), do: s
end
