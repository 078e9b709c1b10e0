defmodule Swarm.Membership.Peers do
  @moduledoc """
  Tracks which robots are present, by the newest heartbeat of each and its age. Pure; times are
  the listener's own, in milliseconds.

  A peer is suspect after 1 s of silence and gone after 2 s. The last pose of a robot that is gone
  stays known, as an obstacle, until the robot is heard elsewhere. A robot that comes back with a
  higher boot number starts again; within one boot only newer sequence numbers count, so that late
  and duplicate heartbeats, including those of a robot's former life, do no harm. Boot numbers may
  be times of day, and clocks may be set back, so any number is accepted from a robot that is
  gone.

  A heartbeat may come by way of a third robot (`Swarm.Message.Forwarder`): it counts as a sign of
  life, but not as heard. The view of the robots present has a number (`members/2`) that grows
  whenever a robot comes, goes, or comes back in another life.
  """
  alias Hal.{Pose, Twist}
  alias Swarm.Membership.Heartbeat

  @suspect_ms 1_000
  @gone_ms 2_000

  @enforce_keys [:me]
  defstruct @enforce_keys ++ [rows: %{}, changes: 0, shown: %{}, oldest_ms: nil, looked_ms: nil]

  @typedoc """
  `at_ms` is when the robot was last heard of, `direct_ms` when it was last heard itself, `nil`
  for never.
  """
  @type row :: %{beat: Heartbeat.t(), at_ms: integer(), direct_ms: integer() | nil}
  @typedoc """
  `changes` counts the robots that came, came back or restarted, up to the last heartbeat. `shown` has all as a percept
  shows them while none is gone. No row is older than `oldest_ms`, found at `looked_ms`: less than 2 s after that
  none can be gone.
  """
  @type t :: %__MODULE__{
          me: atom(),
          rows: %{atom() => row()},
          changes: non_neg_integer(),
          shown: %{atom() => Robot.Percept.peer()},
          oldest_ms: integer() | nil,
          looked_ms: integer() | nil
        }
  @type status :: :alive | :suspect | :gone

  @doc "The state before any robot is heard."
  @spec new(atom()) :: t()
  def new(me), do: %__MODULE__{me: me}

  @doc """
  Hears a heartbeat, directly or (`direct?` false) by way of another robot; an old one, or one
  with the robot's own name, changes nothing.
  """
  @spec hear(t(), atom(), Heartbeat.t(), integer(), direct? :: boolean()) :: t()
  def hear(peers, from, beat, now_ms, direct? \\ true)
  def hear(%{me: me} = peers, me, _beat, _now_ms, _direct?), do: peers

  def hear(peers, from, beat, now_ms, direct?) do
    old = peers.rows[from]

    cond do
      news?(old, beat, now_ms) ->
        direct_ms = if direct?, do: now_ms, else: old && old.direct_ms
        row = %{beat: beat, at_ms: now_ms, direct_ms: direct_ms}
        changes = peers.changes + change(old, beat, now_ms)
        note(%{peers | changes: changes}, from, row, now_ms)

      # The same heartbeat by the direct way, which was overtaken.
      direct? and same?(old.beat, beat) and old.direct_ms != old.at_ms ->
        note(peers, from, %{old | direct_ms: old.at_ms}, now_ms)

      true ->
        peers
    end
  end

  # What it shows is made once a heartbeat, not once a tick.
  defp note(%{rows: rows, shown: shown} = peers, from, row, now_ms) do
    shown = Map.put(shown, from, percept(row, row.at_ms))
    look(%{peers | rows: Map.put(rows, from, row), shown: shown}, now_ms)
  end

  defp look(%{oldest_ms: oldest, looked_ms: looked} = peers, now_ms)
       when oldest != nil and now_ms >= oldest and
              (now_ms - oldest < @suspect_ms or now_ms - looked < @suspect_ms),
       do: peers

  defp look(peers, now_ms) do
    oldest = Enum.reduce(peers.rows, now_ms, fn {_id, %{at_ms: at_ms}}, o -> min(o, at_ms) end)
    %{peers | oldest_ms: oldest, looked_ms: now_ms}
  end

  # A robot that comes counts one; one that was away counts one for leaving and one for returning.
  defp change(nil, _beat, _now_ms), do: 1
  defp change(%{at_ms: at_ms}, _beat, now_ms) when now_ms - at_ms >= @gone_ms, do: 2
  defp change(%{beat: %{boot: boot}}, %{boot: boot}, _now_ms), do: 0
  defp change(_former_life, _beat, _now_ms), do: 1

  defp same?(%{boot: boot, sequence: sequence}, beat),
    do: beat.boot == boot and beat.sequence == sequence

  defp news?(nil, _beat, _now_ms), do: true

  # So that a wrong number does no lasting harm.
  defp news?(%{at_ms: at_ms}, _beat, now_ms) when now_ms - at_ms >= @gone_ms, do: true

  defp news?(%{beat: %{boot: boot, sequence: sequence}}, %{boot: boot} = beat, _now_ms),
    do: beat.sequence > sequence

  defp news?(%{beat: %{boot: boot}}, beat, _now_ms), do: beat.boot > boot

  @doc "The state of a robot, judged by its silence; an unknown one is gone."
  @spec status(t(), atom(), integer()) :: status()
  def status(%{me: me}, me, _now_ms), do: :alive

  def status(peers, id, now_ms) do
    case peers.rows do
      %{^id => %{at_ms: at_ms}} when now_ms - at_ms < @suspect_ms -> :alive
      %{^id => %{at_ms: at_ms}} when now_ms - at_ms < @gone_ms -> :suspect
      _silent -> :gone
    end
  end

  @doc "The names of all robots that are not gone, including this one, sorted."
  @spec view(t(), integer()) :: [atom()]
  def view(peers, now_ms) do
    others = for {id, %{at_ms: at_ms}} <- peers.rows, now_ms - at_ms < @gone_ms, do: id

    Enum.sort([peers.me | others])
  end

  @doc "The names of the robots that are gone."
  @spec gone(t(), integer()) :: [atom()]
  def gone(peers, now_ms),
    do: for({id, %{at_ms: at_ms}} <- peers.rows, now_ms - at_ms >= @gone_ms, do: id)

  @doc """
  The names of the robots heard directly within the last second, sorted; a heartbeat lists these
  as heard.
  """
  @spec heard(t(), integer()) :: [atom()]
  def heard(peers, now_ms) do
    Enum.sort(
      for {id, %{direct_ms: at_ms}} <- peers.rows,
          at_ms != nil and now_ms - at_ms < @suspect_ms,
          do: id
    )
  end

  @doc """
  All other robots that are not gone, each with the number of its life, sorted, and the number of
  this view: it grows with every robot that comes, goes, or comes back in another life.

      iex> beat = %Swarm.Membership.Heartbeat{boot: 7, sequence: 1, pose: {0, 0, 0}, twist: {0, 0}}
      iex> peers = Swarm.Membership.Peers.hear(Swarm.Membership.Peers.new(:mag1), :mag2, beat, 0)
      iex> {Swarm.Membership.Peers.members(peers, 100), Swarm.Membership.Peers.members(peers, 2_000)}
      {{1, [mag2: 7]}, {2, []}}
  """
  @spec members(t(), integer()) :: {number :: non_neg_integer(), [{atom(), boot :: integer()}]}
  def members(peers, now_ms) do
    there =
      for {id, %{at_ms: at_ms, beat: beat}} <- peers.rows,
          now_ms - at_ms < @gone_ms,
          do: {id, beat.boot}

    {view_number(peers, now_ms), Enum.sort(there)}
  end

  @doc "The number of the view of `members/2`."
  @spec view_number(t(), integer()) :: non_neg_integer()
  def view_number(peers, now_ms), do: peers.changes + length(gone(peers, now_ms))

  @doc "The newest heartbeats of all that are not gone, by name, without this robot's."
  @spec beats(t(), integer()) :: %{atom() => Heartbeat.t()}
  def beats(peers, now_ms) do
    for {id, %{at_ms: at_ms, beat: beat}} <- peers.rows, now_ms - at_ms < @gone_ms, into: %{} do
      {id, beat}
    end
  end

  @doc "The peers as a percept shows them, for the avoidance."
  @spec percepts(t(), integer()) :: %{atom() => Robot.Percept.peer()}
  def percepts(%{oldest_ms: oldest, shown: shown}, now_ms)
      when oldest != nil and now_ms - oldest < @gone_ms,
      do: shown

  def percepts(peers, now_ms),
    do: Map.new(peers.rows, fn {id, row} -> {id, percept(row, now_ms)} end)

  @doc "One of these peers; the robot must have been heard before."
  @spec percept(t(), atom(), integer()) :: Robot.Percept.peer()
  def percept(peers, id, now_ms), do: percept(Map.fetch!(peers.rows, id), now_ms)

  defp percept(%{beat: beat, at_ms: at_ms, direct_ms: direct_ms}, now_ms) do
    {x, y, heading} = beat.pose
    {linear, turn} = beat.twist

    %{
      pose: Pose.new(x / 1000, y / 1000, heading / 1000),
      twist: Twist.new(linear / 1000, turn / 1000),
      radius: beat.radius / 1000,
      at_ms: at_ms,
      direct_ms: direct_ms,
      mode: mode(beat, now_ms - at_ms),
      beat: beat
    }
  end

  @doc "The newest heartbeats of all in a percept's peers that are not gone, by name."
  @spec taking_part(%{atom() => Robot.Percept.peer()}, integer()) :: %{atom() => Heartbeat.t()}
  def taking_part(peers, now_ms) do
    for {id, %{at_ms: at_ms, beat: beat}} <- peers, now_ms - at_ms < @gone_ms, into: %{} do
      {id, beat}
    end
  end

  defp mode(_beat, age_ms) when age_ms >= @gone_ms, do: :dead
  defp mode(%{standing: true}, _age_ms), do: :holding
  defp mode(_beat, _age_ms), do: :moving
end
