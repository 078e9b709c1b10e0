defmodule Lab.FreezeTest do
  @moduledoc "The leader's process of the operating system is frozen for about as long as its lease."
  use ExUnit.Case, async: false
  alias Lab.Fleet
  @moduletag :long
  @moduletag :capture_log

  @ids [:mag1, :mag2, :min1, :min2]
  @freezes 30

  defp wait(ms), do: receive(do: (:never -> :ok), after: (ms -> :ok))

  defp leader(fleet, left \\ 600) do
    case Fleet.result(fleet).leader do
      nil when left > 0 ->
        wait(50)
        leader(fleet, left - 1)

      leader ->
        assert leader != nil
        leader
    end
  end

  defp signal(pid, signal), do: assert({_, 0} = System.cmd("kill", ["-#{signal}", pid]))

  test "30 freezes of 1.8 to 2.4 s: ten times a second nobody sees two leaders" do
    {:ok, fleet} = Fleet.start_link(nodes: true, robots: @ids, seed: 2)

    pids =
      for line <- Fleet.lines(fleet),
          [_line, id, pid] <- [Regex.run(~r/^(\w+)\s+pid\s+(\d+)/, line)],
          into: %{},
          do: {id, pid}

    leaders =
      for _ <- 1..@freezes do
        leader(fleet)
        wait(600 + :rand.uniform(800))
        leader = leader(fleet)
        signal(pids["#{leader}"], "STOP")
        wait(1_799 + :rand.uniform(601))
        signal(pids["#{leader}"], "CONT")
        wait(1_200)
        assert Fleet.result(fleet).leaders_at_once_max == 1
        leader
      end

    # In many of them another robot did lead meanwhile.
    assert length(Enum.dedup(leaders)) > 5
    epochs = for %{stage: :elected, epoch: epoch} <- Fleet.scene(fleet).stages, do: epoch
    assert epochs == Enum.sort(epochs)
    assert epochs == Enum.uniq(epochs)
    Fleet.stop(fleet)
  end
end
