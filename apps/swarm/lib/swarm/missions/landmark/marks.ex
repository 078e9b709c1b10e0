defmodule Swarm.Missions.Landmark.Marks do
  @moduledoc """
  What a follower finds its pose by: the leader's frame, the landmark as the leader told it, and the robots
  ahead of it in the order where they say they are, each as sure as it says. And when that makes it sure
  enough to say that it is in its place. Pure.

  Only those ahead in the order, so that corrections run one way, from the leader down. All others may be seen, too,
  and must not be taken for one of these.
  """
  alias Hal.Pose
  alias Robot.Localiser.Anchors
  alias Swarm.Missions.Landmark.{Places, State}

  @robot_colour "RedRobot"
  # How well the leader knows the landmark's place in its own frame, and where it is itself, in metres.
  @landmark_sd 0.02
  @leader_sd 0.02
  @landmark_radius 0.15
  # Slower than this a robot stands, in m/s and rad/s.
  @slow 0.05
  # A robot in its place is no farther from it than this, in 95 of 100 cases, in metres.
  @tolerance 0.5

  @doc "The anchors of a follower that has a pose and an anchor of its leader."
  @spec anchors(State.t()) :: Anchors.t()
  def anchors(%{anchor: anchor, percept: percept} = mission) do
    {leader, _twist} = Places.leader(anchor, mission.now_ms - mission.anchor_ms)
    ahead = [anchor.leader | Enum.take_while(anchor.order, &(&1 != mission.me))]

    # In an order that no virtual machine chooses: each correction changes the next.
    robots =
      for {id, peer} <- Enum.sort(percept.peers) do
        %{
          key: {:robot, id},
          kind: :robot,
          colour: @robot_colour,
          at: Pose.point(if id == anchor.leader, do: leader, else: peer.pose),
          sd: if(id in ahead and standing?(peer), do: sd(id, peer, anchor)),
          radius: peer.radius
        }
      end

    %Anchors{frame: frame(mission, leader), marks: landmark(mission) ++ robots}
  end

  # A landmark that moves is somewhere else by now.
  defp landmark(%{anchor: %{still: true, landmark: place} = anchor} = mission)
       when place != nil do
    [
      %{
        key: :landmark,
        kind: :landmark,
        colour: mission.colour,
        at: Places.landmark(anchor),
        sd: @landmark_sd,
        radius: @landmark_radius
      }
    ]
  end

  defp landmark(_mission), do: []

  # What a moving robot told is where it was, and where a dead one came to rest nobody knows.
  defp standing?(%{mode: :dead}), do: false

  defp standing?(%{mode: :moving, twist: twist}),
    do: abs(twist.linear) < @slow and abs(twist.turn) < @slow

  defp standing?(_holding), do: true

  # Who is not in the leader's frame yet cannot tell where it is there.
  defp sd(leader, _peer, %{leader: leader}), do: @leader_sd

  defp sd(_id, %{beat: %{sd: mm, leader: leader, epoch: epoch}}, anchor)
       when mm != nil and leader == anchor.leader and epoch == anchor.epoch,
       do: mm / 1000

  defp sd(_id, _peer, _anchor), do: nil

  defp frame(%{anchor: %{drift: {way, turn, turned}} = anchor} = mission, leader) do
    {position, heading} = variances(anchor.sd)

    %{
      key: key(mission),
      base: anchor.base,
      at: Pose.point(leader),
      position: position,
      heading: heading,
      start: variances(anchor.start_sd),
      drift: {way / 1.0e6, turn / 1.0e6, turned / 1000},
      slip: anchor.slip / 1000
    }
  end

  defp variances({mm, mrad}), do: {mm * mm / 1.0e6, mrad * mrad / 1.0e6}

  # A leader that was started anew numbers its frames anew.
  defp key(%{anchor: %{leader: leader, frame: number}, percept: percept}) do
    case percept.peers do
      %{^leader => %{beat: %{boot: boot}}} -> {leader, boot, number}
      _nothing_heard -> {leader, nil, number}
    end
  end

  @doc """
  How well a robot knows its pose in its leader's frame, as heartbeats tell it: the standard deviation of its
  position along the worst direction, in mm; `nil` where it has not come into that frame yet, or has none.
  """
  @spec told(State.t()) :: non_neg_integer() | nil
  def told(%{anchor: %{}, percept: %{uncertainty: %{frame: frame, position: sd}}} = mission) do
    if frame == key(mission), do: min(round(sd * 1000), 100_000)
  end

  def told(_mission), do: nil

  @doc """
  Whether a follower that believes it is this far from its slot (metres) is within half a metre of it in 95 of 100 cases.

      iex> peers = %{mag2: %{beat: %{boot: 7}}}
      iex> percept = %{uncertainty: %{radius: 0.3, frame: {:mag2, 7, 3}}, peers: peers}
      iex> mission = %{anchor: %{leader: :mag2, frame: 3}, percept: percept}
      iex> Enum.map([0.1, 0.25], &Swarm.Missions.Landmark.Marks.sure?(mission, &1))
      [true, false]
  """
  @spec sure?(State.t() | map(), error :: float()) :: boolean()
  def sure?(%{percept: %{uncertainty: %{frame: frame, radius: radius}}} = mission, error),
    do: frame == key(mission) and error + radius <= @tolerance

  def sure?(_mission, _error), do: false
end
