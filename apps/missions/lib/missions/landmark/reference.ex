defmodule Missions.Landmark.Reference do
  @moduledoc """
  Says where the leader is supposed to be, and the shape relative to it: everything that a follower
  needs to compute its slot. The leader makes a new reference each tick; it travels in the
  leader's claim and, from parent to child, along the chain (n - 1 messages), so
  that a follower that does not hear the leader still knows its place. The newest sequence number
  wins; the epoch excludes former leaders.

  Poses are `{x_mm, y_mm, mrad}` in the leader's map frame. Its own uncertainty (standard
  deviations in mm and mrad) is `sd` in the frame `base` that it was in before, and `start_sd` in
  that of the start poses; `frame` is the number of its own frame. `drift` is how much its
  odometry has drifted since it was started (variances in mm2 and millionths of rad2, sum of all
  turned angles in mrad), `slip` the uncertainty of the share of an angle by which it slips (a
  standard deviation, in thousandths). `landmark` is `{x_mm, y_mm}` or `nil`, `still` says that it
  does not move. `order` names the followers by slot, which is also the order in which each passes
  the anchor on to its child. `formation` is the shape that there is room for, `asked` the
  requested one, which was the `asked_no`-th request; `size` and `places` say which slots of it
  are used (`Swarm.Formation.FreeSlots`), `trail` gives them pose by pose if the shape is a column
  along the leader's trail. `of` is the size of the fleet of which a majority must be together for
  any robot to lead, 0 if none is required (`Missions.Landmark.Policy`).
  """
  alias Swarm.Formation
  alias Swarm.Wire

  @enforce_keys [:leader, :epoch, :sequence, :pose, :twist, :formation, :order, :size, :places]
  defstruct @enforce_keys ++
              [
                sd: {0, 0},
                start_sd: {0, 0},
                drift: {0, 0, 0},
                slip: 0,
                frame: 0,
                base: nil,
                asked: nil,
                asked_no: 0,
                landmark: nil,
                still: false,
                trail: nil,
                of: 0
              ]

  @typedoc """
  The robot that owns the frame, the number of its life, and the number of the frame in that life.
  """
  @type frame :: {atom(), boot :: non_neg_integer() | nil, non_neg_integer()}
  @type t :: %__MODULE__{
          leader: atom(),
          epoch: pos_integer(),
          sequence: non_neg_integer(),
          pose: {integer(), integer(), integer()},
          twist: {integer(), integer()},
          sd: {position :: non_neg_integer(), heading :: non_neg_integer()},
          start_sd: {position :: non_neg_integer(), heading :: non_neg_integer()},
          drift:
            {way :: non_neg_integer(), turn :: non_neg_integer(), turned :: non_neg_integer()},
          slip: non_neg_integer(),
          frame: non_neg_integer(),
          base: frame() | nil,
          formation: Formation.t(),
          order: [atom()],
          landmark: {integer(), integer()} | nil,
          still: boolean(),
          size: pos_integer(),
          places: [pos_integer()],
          asked: Formation.t() | nil,
          asked_no: non_neg_integer(),
          trail: [{integer(), integer(), integer()}] | nil,
          of: non_neg_integer()
        }

  @most 1_000

  @doc """
  Which of two anchors a follower believes: higher epoch, then newer sequence.

      iex> old = %Missions.Landmark.Reference{leader: :mag1, epoch: 1, sequence: 9, pose: {0, 0, 0}, twist: {0, 0},
      ...>   formation: {:column, 1.0}, order: [], size: 1, places: []}
      iex> Missions.Landmark.Reference.newest(old, %{old | epoch: 2, sequence: 0}).epoch
      2
      iex> Missions.Landmark.Reference.newest(nil, old) == old
      true
  """
  @spec newest(t() | nil, t()) :: t()
  def newest(nil, anchor), do: anchor

  def newest(old, new),
    do: if({new.epoch, new.sequence} > {old.epoch, old.sequence}, do: new, else: old)

  @doc "Whether a term from outside is an anchor with sane numbers."
  @spec valid?(term()) :: boolean()
  def valid?(%__MODULE__{twist: {v, w}, order: order, places: places} = anchor) do
    Wire.whole?(anchor, __MODULE__) and Wire.pose?(anchor.pose) and Wire.number?(v) and
      Wire.number?(w) and Wire.name?(anchor.leader) and Wire.counter?(anchor.epoch) and
      anchor.epoch > 0 and Wire.counter?(anchor.sequence) and
      Formation.valid?(anchor.formation) and
      (anchor.asked == nil or Formation.valid?(anchor.asked)) and
      Wire.counter?(anchor.asked_no) and
      Wire.names?(order) and Wire.distinct?(order) and anchor.leader not in order and
      anchor.size in 1..@most and
      Wire.list?(places, &(&1 in 1..@most and &1 < anchor.size)) and
      length(places) == length(order) and Wire.distinct?(places) and
      sizes?(anchor.sd, 2) and sizes?(anchor.start_sd, 2) and sizes?(anchor.drift, 3) and
      size?(anchor.slip) and Wire.count?(anchor.frame) and base?(anchor.base) and
      landmark?(anchor.landmark) and is_boolean(anchor.still) and
      is_integer(anchor.of) and anchor.of in 0..@most and
      (anchor.trail == nil or
         (Wire.list?(anchor.trail, &Wire.pose?/1) and
            length(anchor.trail) == length(order)))
  end

  def valid?(_term), do: false

  defp sizes?(term, count) when is_tuple(term) and tuple_size(term) == count,
    do: term |> Tuple.to_list() |> Enum.all?(&size?/1)

  defp sizes?(_other, _count), do: false

  defp size?(term), do: Wire.number?(term) and term >= 0

  defp base?(nil), do: true

  defp base?({name, boot, number}),
    do:
      Wire.name?(name) and (boot == nil or Wire.boot?(boot)) and
        Wire.count?(number)

  defp base?(_other), do: false

  defp landmark?(nil), do: true
  defp landmark?({x, y}), do: Wire.number?(x) and Wire.number?(y)
  defp landmark?(_other), do: false
end
