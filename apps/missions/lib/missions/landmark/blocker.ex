defmodule Missions.Landmark.Blocker do
  @moduledoc """
  Finds what keeps a follower from its slot, from what it knows about its surroundings. Pure.

  | blocker | is |
  |---|---|
  | `:landmark` | the landmark, in the slot or on the way to it |
  | `{:robot, id}` | a robot, dead, standing or passing, in the slot or on the way |
  | `:unknown` | something that the sonars see, and that no robot has reported and no map shows |
  | `:no_turn` | what is so near to its corners that its gate does not let it turn |
  | `:no_way` | none of these: known obstacles leave no way, or the robot finds none |
  | `:no_anchor` | the leader has not said where its place is |
  """
  alias Hal.Pose
  alias Robot.Behaviour.Blocker
  alias Robot.Percept
  alias Missions.Landmark.LandmarkTrack

  @type t :: :landmark | :no_anchor | Blocker.t()

  @doc """
  The blocker between a percept's pose and a slot, both in the map frame in metres; `nil` as the
  landmark's place means that it is unknown (`Robot.Behaviour.Blocker.find/3`).
  """
  @spec find(Percept.t(), Pose.t(), Pose.point() | nil) :: t()
  def find(%Percept{} = percept, slot, landmark) do
    marks = if landmark, do: [{:landmark, landmark, LandmarkTrack.radius()}], else: []
    Blocker.find(percept, Pose.point(slot), marks)
  end

  @doc """
  A blocker in words, to follow "blocked by".

      iex> for b <- [:landmark, {:robot, :mag2}, nil], do: Missions.Landmark.Blocker.words(b)
      ["the landmark", "mag2", nil]
  """
  @spec words(t() | nil) :: String.t() | nil
  def words(:landmark), do: "the landmark"
  def words(:no_anchor), do: "no word of its leader"
  def words(blocker), do: Blocker.words(blocker)
end
