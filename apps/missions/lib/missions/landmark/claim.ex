defmodule Missions.Landmark.Claim do
  @moduledoc """
  Describes what a robot says of its landmark mission to all others, with its heartbeats (`Robot.Mission.Claim`). Pure.

  `epoch` is that of the election which it knows; `sight` its newest view of the landmark, relative size in millionths and
  estimated distance in mm, `nil` if it does not see it; `sd` the uncertainty of its place in its leader's frame, `nil` outside
  it. `blind` says that its camera has given no picture for long, `in_place` that a follower is in its slot, `unsure` that it believes so but is not sure
  enough, or that it is on its way and does not know its place to within a metre, `blocked` that it
  does not get there, `formed` that all do. `sees` is a robot without pictures that it sees, and where. Only a leader has an `anchor`.
  """
  alias Missions.Landmark.Reference
  alias Swarm.Membership.Heartbeat
  alias Swarm.Wire

  @typedoc "Standard deviations of a place in mm, along the worst direction and across it, and that direction in mrad."
  @type spread :: {worst :: non_neg_integer(), least :: non_neg_integer(), direction :: integer()}

  @typedoc "Where a robot sees another one: in mm, in the leader's frame, with the standard deviation of that place in mm."
  @type seen :: {atom(), {x_mm :: integer(), y_mm :: integer()}, sd_mm :: non_neg_integer()}

  defstruct epoch: 0,
            sight: nil,
            sd: nil,
            in_place: false,
            unsure: false,
            blind: false,
            blocked: false,
            formed: false,
            sees: nil,
            anchor: nil

  @typedoc "What heartbeats carry."
  @type t :: %__MODULE__{
          epoch: non_neg_integer(),
          sight: %{size_ppm: non_neg_integer(), distance: non_neg_integer() | nil} | nil,
          sd: spread() | nil,
          in_place: boolean(),
          unsure: boolean(),
          blind: boolean(),
          blocked: boolean(),
          formed: boolean(),
          sees: seen() | nil,
          anchor: Reference.t() | nil
        }

  @doc """
  What a robot claims of this mission by its heartbeat; one without it claims nothing.

      iex> beat = %Swarm.Membership.Heartbeat{boot: 1, sequence: 1, pose: {0, 0, 0}, twist: {0, 0}}
      iex> Missions.Landmark.Claim.of(beat).epoch
      0
  """
  @spec of(Heartbeat.t()) :: t()
  def of(%{claim: %{fields: %__MODULE__{} = claim}}), do: claim
  def of(_without), do: %__MODULE__{}

  @doc """
  Whether the numbers of one from outside are sane.

      iex> for epoch <- [3, -1], do: Missions.Landmark.Claim.valid?(%Missions.Landmark.Claim{epoch: epoch})
      [true, false]
  """
  @spec valid?(t()) :: boolean()
  def valid?(%__MODULE__{} = claim) do
    Wire.counter?(claim.epoch) and sight?(claim.sight) and spread?(claim.sd) and
      Enum.all?(
        [claim.in_place, claim.unsure, claim.blind, claim.blocked, claim.formed],
        &is_boolean/1
      ) and
      seen?(claim.sees) and (claim.anchor == nil or Reference.valid?(claim.anchor))
  end

  defp spread?(nil), do: true

  defp spread?({worst, least, direction}),
    do: worst in 0..100_000 and least in 0..100_000 and direction in -4_000..4_000

  defp spread?(_other), do: false

  defp seen?(nil), do: true

  defp seen?({id, {x, y}, sd}),
    do: Wire.name?(id) and Wire.number?(x) and Wire.number?(y) and sd in 0..100_000

  defp seen?(_other), do: false

  defp sight?(nil), do: true

  defp sight?(%{size_ppm: size, distance: distance} = sight) do
    map_size(sight) == 2 and size in 0..1_000_000 and
      (distance == nil or distance in 0..1_000_000)
  end

  defp sight?(_other), do: false

  @doc """
  What a claim says (`c:Robot.Mission.account/1`): the state is its phase, or how a follower fares.

      iex> for more <- [%{}, %{in_place: true}, %{unsure: true}, %{blocked: true}],
      ...>   do: Missions.Landmark.Claim.account(Map.put(more, :phase, :follow)).state
      [:follow, :in_place, :unsure, :blocked]
      iex> Missions.Landmark.Claim.account(%{})
      %{state: :idle, says: [], sight: nil}
  """
  @spec account(map()) :: Robot.Mission.account()
  def account(claim) do
    says = for word <- [:in_place, :unsure, :blocked], claim[word] == true, do: word
    %{state: state(claim), says: says, sight: claim[:sight]}
  end

  defp state(%{blocked: true}), do: :blocked
  defp state(%{phase: :follow, in_place: true}), do: :in_place
  defp state(%{phase: :follow, unsure: true}), do: :unsure
  defp state(%{phase: phase}), do: phase
  defp state(_new), do: :idle

  @doc """
  A leadership lapses after a second of silence: others may have elected another leader by then. An anchor is good for as long,
  so no robot follows a leader that has decided nothing since.

      iex> Missions.Landmark.Claim.stale(%{phase: :lead, leader: :mag1, epoch: 3, formed: true, anchor: nil})
      %{phase: :agree, leader: nil, epoch: 3, formed: false, anchor: nil}
      iex> Missions.Landmark.Claim.stale(%{phase: :follow, leader: :mag2})
      %{phase: :follow, leader: :mag2}
  """
  @spec stale(map()) :: map()
  def stale(%{phase: :lead} = claim),
    do: Map.merge(claim, %{phase: :agree, leader: nil, formed: false, anchor: nil})

  def stale(claim), do: claim
end
