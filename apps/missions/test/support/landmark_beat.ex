defmodule Missions.Landmark.Beat do
  @moduledoc "Heartbeats of robots that run the landmark mission."
  alias Missions.Landmark
  alias Robot.Mission.Claim
  alias Swarm.Membership.Heartbeat

  @doc "One with these fields, of the body and of the mission's claim."
  def new(fields \\ []) do
    {claim, body} = Keyword.split(fields, Map.keys(%Landmark.Claim{}))
    plain = [boot: 1, sequence: 1, pose: {0, 0, 0}, twist: {0, 0}]
    struct!(Heartbeat, plain ++ [claim: Claim.new(Landmark, Map.new(claim))] ++ body)
  end

  @doc "An anchor of :mag1, which leads a column of these followers and says where the landmark is (mm)."
  def anchor(order, landmark) do
    followers = length(order)
    shape = [formation: {:column, 1.0}, size: followers + 1, places: Enum.to_list(1..followers)]
    here = [leader: :mag1, epoch: 1, sequence: 1, pose: {0, 0, 0}, twist: {0, 0}]
    struct!(Landmark.Reference, here ++ shape ++ [order: order, landmark: landmark])
  end

  @doc "The message by which a robot passes an anchor on to its child."
  def pass_on(from, anchor) do
    claim = Robot.Mission.Claim.new(Missions.Landmark, %{anchor: anchor})
    Swarm.Message.new(from, :claim, claim)
  end
end
