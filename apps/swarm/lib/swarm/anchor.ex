defmodule Swarm.Anchor do
  @moduledoc """
  Where the leader is supposed to be, and the shape that hangs from it: all that a follower needs
  to compute its slot. The leader makes a new one each tick; it travels in the leader's heartbeats
  and, from parent to child, along the chain (R28, R53: n - 1 messages), so that a follower that
  does not hear the leader still knows its place. The newest sequence number wins; the epoch
  fences off leaders of the past.

  Poses are `{x_mm, y_mm, mrad}` in the leader's map frame; `landmark` is `{x_mm, y_mm}` or `nil`,
  `still` says that it does not move. `order` names the followers by slot; `chain` the same with
  the leader first, in the order in which each passes the anchor on to its child. `trail?` makes
  the shape a column along the leader's trail.
  """

  @enforce_keys [:leader, :epoch, :sequence, :pose, :twist, :formation, :order]
  defstruct @enforce_keys ++ [landmark: nil, still: false, trail?: false, hold: false]

  @type t :: %__MODULE__{
          leader: atom(),
          epoch: pos_integer(),
          sequence: non_neg_integer(),
          pose: {integer(), integer(), integer()},
          twist: {integer(), integer()},
          formation: Swarm.Formation.t(),
          order: [atom()],
          landmark: {integer(), integer()} | nil,
          still: boolean(),
          trail?: boolean(),
          hold: boolean()
        }

  @far 1_000_000_000

  @doc """
  Which of two anchors a follower believes: higher epoch, then newer sequence.

      iex> old = %Swarm.Anchor{leader: :mag1, epoch: 1, sequence: 9, pose: {0, 0, 0}, twist: {0, 0},
      ...>   formation: {:column, 1.0}, order: []}
      iex> Swarm.Anchor.newest(old, %{old | epoch: 2, sequence: 0}).epoch
      2
      iex> Swarm.Anchor.newest(nil, old) == old
      true
  """
  @spec newest(t() | nil, t()) :: t()
  def newest(nil, anchor), do: anchor

  def newest(old, new),
    do: if({new.epoch, new.sequence} > {old.epoch, old.sequence}, do: new, else: old)

  @doc "Whether a term from outside is an anchor with sane numbers."
  @spec valid?(term()) :: boolean()
  def valid?(%__MODULE__{pose: {x, y, heading}, twist: {v, w}, formation: {kind, d}} = anchor) do
    Enum.all?([x, y, heading, v, w], &(is_integer(&1) and abs(&1) < @far)) and
      is_atom(anchor.leader) and is_integer(anchor.epoch) and anchor.epoch > 0 and
      is_integer(anchor.sequence) and kind in Swarm.Formation.kinds() and is_float(d) and
      d >= Swarm.Formation.least_spacing() and d < 100 and
      is_list(anchor.order) and Enum.all?(anchor.order, &is_atom/1) and
      landmark?(anchor.landmark) and
      Enum.all?([anchor.still, anchor.trail?, anchor.hold], &is_boolean/1)
  end

  def valid?(_term), do: false

  defp landmark?(nil), do: true

  defp landmark?({x, y}),
    do: is_integer(x) and is_integer(y) and abs(x) < @far and abs(y) < @far

  defp landmark?(_other), do: false
end
