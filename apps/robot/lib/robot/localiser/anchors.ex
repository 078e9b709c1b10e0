defmodule Robot.Localiser.Anchors do
  @moduledoc """
  What a mission tells the localiser to find its pose by: in whose frame, and which things are where. Pure data.

  The frame is that of a robot that nobody corrects, the leader: what it believes of its own pose is so by definition,
  and what it is unsure of, all others are unsure of: when they come into its frame, of its pose in the one that it was in
  before it led (`base`), and from then on, of what its odometry adds.
  """
  alias Hal.Pose

  defstruct frame: nil, marks: []

  @typedoc """
  `key` tells one frame from another, `base` is the key of the one that its variances (`position`, `heading`: m2, rad2) are in,
  `nil` for that of the start poses; `start` are the variances in the latter. `at` is where its robot believes itself to be. `drift` is
  by what its odometry has drifted since it was started: variances of way and turn, and all angles turned (radians); `slip`
  (a standard deviation) how well it knows what slips in each of them alike.
  """
  @type frame :: %{
          key: term(),
          base: term(),
          at: Pose.point(),
          position: float(),
          heading: float(),
          start: {position :: float(), heading :: float()},
          drift: {way :: float(), turn :: float(), turned :: float()},
          slip: float()
        }

  @typedoc """
  Something of a colour at a place (metres, in the frame). `sd` is how well the place is known, in metres; with
  `nil` it may be seen and taken for another, but nothing is measured by it. A `:landmark` is the only thing of
  its colour; of robots there are many, and only a blob as wide as a cylinder of the `radius` (metres) is one.
  """
  @type mark :: %{
          key: term(),
          kind: :landmark | :robot,
          colour: String.t(),
          at: Pose.point(),
          sd: float() | nil,
          radius: float()
        }

  @type t :: %__MODULE__{frame: frame() | nil, marks: [mark()]}
end
