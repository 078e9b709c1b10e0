defmodule Missions.Landmark.Company do
  @moduledoc """
  Looks through the other robots that are not gone, once a tick, for all that the mission asks of them. Pure.
  """
  alias Missions.Landmark.Claim
  alias Swarm.Membership.{Heartbeat, Peers}
  alias Missions.Landmark.Reference

  @enforce_keys [:beats, :view, :epochs, :leading_epoch, :anchored?]
  defstruct @enforce_keys

  @typedoc """
  `beats` are their newest heartbeats; `view` the names of all that take part in the mission, this robot's too, sorted, and
  `epochs` what epochs the others of these claim; `leading_epoch` the highest of a leader, -1 without one. `anchored?`:
  some heartbeat has an anchor.
  """
  @type t :: %__MODULE__{
          beats: %{atom() => Heartbeat.t()},
          view: [atom()],
          epochs: [non_neg_integer()],
          leading_epoch: integer(),
          anchored?: boolean()
        }

  @doc """
  The company of a robot among the peers of its percept.

      iex> claim = Robot.Mission.Claim.new(Missions.Landmark, %{epoch: 3})
      iex> beat = %Swarm.Membership.Heartbeat{boot: 1, sequence: 1, pose: {0, 0, 0}, twist: {0, 0}, phase: :lead, claim: claim}
      iex> peers = %{mag2: %{at_ms: 0, beat: beat}}
      iex> company = Missions.Landmark.Company.of(:mag1, peers, 100)
      iex> {company.view, company.epochs, company.leading_epoch, Missions.Landmark.Company.of(:mag1, peers, 2_000).view}
      {[:mag1, :mag2], [3], 3, [:mag1]}
  """
  @spec of(atom(), %{atom() => Robot.Percept.peer()}, integer()) :: t()
  def of(me, peers, now_ms) do
    beats = Peers.taking_part(peers, now_ms)
    {view, epochs, leading, anchored?} = look(Map.to_list(beats), [me], [], -1, false)

    %__MODULE__{
      beats: beats,
      view: Enum.sort(view),
      epochs: epochs,
      leading_epoch: leading,
      anchored?: anchored?
    }
  end

  defp look(
         [{id, %{phase: phase, claim: %{fields: %Claim{} = claim}}} | beats],
         view,
         epochs,
         leading,
         anchored?
       ) do
    %{epoch: epoch, anchor: anchor} = claim
    leading = if phase == :lead and epoch > leading, do: epoch, else: leading
    anchored? = anchored? or is_struct(anchor, Reference)

    if phase == :idle,
      do: look(beats, view, epochs, leading, anchored?),
      else: look(beats, [id | view], [epoch | epochs], leading, anchored?)
  end

  # Of another mission, or of none.
  defp look([_other | beats], view, epochs, leading, anchored?),
    do: look(beats, view, epochs, leading, anchored?)

  defp look([], view, epochs, leading, anchored?), do: {view, epochs, leading, anchored?}
end
