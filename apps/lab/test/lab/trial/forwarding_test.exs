defmodule Lab.Trial.ForwardingTest do
  @moduledoc "Robots that only a third hears are one group, whatever the mission is."
  use Lab.LockstepCase, async: true
  alias Lab.Trial
  alias Swarm.Member
  alias Swarm.Membership.Peers

  @fleet [:mag1, :mag2, :mag3]
  @cut {0, :end, {:link, :mag1, :mag3}}

  # Whose letters its mission has heard.
  defp heard(%Missions.Flock{heard: heard}), do: Map.keys(heard)
  defp heard(%{peers: peers}), do: Map.keys(peers)

  defp receiver(member), do: Member.role(member, :comms).receiver

  defp run(mission, seconds, options \\ []) do
    all = %{robots: @fleet, landmark: :none, blobs: :direct, mission: mission, cuts: [@cut]}
    {:ok, trial} = Trial.new(Map.merge(all, Map.new(options)))
    Enum.reduce(1..(seconds * 10), trial, fn _tick, trial -> Trial.step(trial) end)
  end

  for mission <- [:patrol, :flock, :explore] do
    test "in a mission of the kind #{mission} they see each other, and hear each other's letters" do
      trial = run(unquote(mission), 4)

      for {me, other} <- [mag3: :mag1, mag1: :mag3] do
        member = Trial.robot(trial, me)
        assert Peers.view(receiver(member).peers, trial.at_ms) == @fleet
        assert other not in Peers.heard(receiver(member).peers, trial.at_ms)
        assert other in heard(Member.runner(member).mission)
      end
    end
  end

  test "robots that do nothing forward, too" do
    {:ok, setup} = Trial.setup(%{robots: @fleet, landmark: :none, blobs: :direct, cuts: [@cut]})

    trial = Enum.reduce(1..20, Trial.still(setup), fn _tick, trial -> Trial.step(trial) end)

    member = Trial.robot(trial, :mag3)
    assert Member.runner(member).phase == :idle
    assert Peers.view(receiver(member).peers, trial.at_ms) == @fleet
  end

  test "where all hear each other, nothing is forwarded" do
    together = run(:patrol, 4, cuts: [])
    for id <- @fleet, do: assert(receiver(Trial.robot(together, id)).forwarder.missing == %{})
  end
end
