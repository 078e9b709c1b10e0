defmodule Swarm.Peers do
  @moduledoc """
  Who is there, by what is heard: the newest heartbeat of each robot, and its age. Pure; times are
  the listener's own, in milliseconds.

  A peer is suspect after 1 s of silence and gone after 2 s. A gone robot's last pose stays known,
  as an obstacle, until it is heard from elsewhere. A robot that comes back with a higher boot
  number starts anew; within one boot only newer sequence numbers count, so that late and doubled
  heartbeats do no harm, those of a robot's former life included. Boot numbers may be times of day,
  and clocks are set back: from a robot that is gone any number is believed.
  """
  alias Hal.{Pose, Twist}
  alias Swarm.Heartbeat

  @suspect_ms 1_000
  @gone_ms 2_000

  @enforce_keys [:me]
  defstruct @enforce_keys ++ [rows: %{}]

  @type row :: %{beat: Heartbeat.t(), at_ms: integer()}
  @type t :: %__MODULE__{me: atom(), rows: %{atom() => row()}}
  @type status :: :alive | :suspect | :gone

  @doc "Nobody heard yet."
  @spec new(atom()) :: t()
  def new(me), do: %__MODULE__{me: me}

  @doc "Hears a heartbeat; an old one, or one of the robot's own name, changes nothing."
  @spec hear(t(), atom(), Heartbeat.t(), integer()) :: t()
  def hear(%{me: me} = peers, me, _beat, _now_ms), do: peers

  def hear(peers, from, beat, now_ms) do
    if news?(peers.rows[from], beat, now_ms),
      do: %{peers | rows: Map.put(peers.rows, from, %{beat: beat, at_ms: now_ms})},
      else: peers
  end

  defp news?(nil, _beat, _now_ms), do: true

  # So that a number that was wrong does no lasting harm.
  defp news?(%{at_ms: at_ms}, _beat, now_ms) when now_ms - at_ms >= @gone_ms, do: true

  defp news?(%{beat: %{boot: boot, sequence: sequence}}, %{boot: boot} = beat, _now_ms),
    do: beat.sequence > sequence

  defp news?(%{beat: %{boot: boot}}, beat, _now_ms), do: beat.boot > boot

  @doc "How a robot is, judged by its silence; an unknown one is gone."
  @spec status(t(), atom(), integer()) :: status()
  def status(%{me: me}, me, _now_ms), do: :alive

  def status(peers, id, now_ms) do
    case peers.rows do
      %{^id => %{at_ms: at_ms}} when now_ms - at_ms < @suspect_ms -> :alive
      %{^id => %{at_ms: at_ms}} when now_ms - at_ms < @gone_ms -> :suspect
      _silent -> :gone
    end
  end

  @doc "The names of all that are not gone, this robot too, sorted."
  @spec view(t(), integer()) :: [atom()]
  def view(peers, now_ms) do
    others = for {id, %{at_ms: at_ms}} <- peers.rows, now_ms - at_ms < @gone_ms, do: id

    Enum.sort([peers.me | others])
  end

  @doc "The names of those that are gone."
  @spec gone(t(), integer()) :: [atom()]
  def gone(peers, now_ms),
    do: for({id, %{at_ms: at_ms}} <- peers.rows, now_ms - at_ms >= @gone_ms, do: id)

  @doc "The names of those heard within the last second, sorted; this is what a heartbeat lists as heard."
  @spec heard(t(), integer()) :: [atom()]
  def heard(peers, now_ms) do
    Enum.sort(for {id, %{at_ms: at_ms}} <- peers.rows, now_ms - at_ms < @suspect_ms, do: id)
  end

  @doc "The newest heartbeat of a robot that is not gone, or `nil`."
  @spec beat(t(), atom(), integer()) :: Heartbeat.t() | nil
  def beat(peers, id, now_ms) do
    case peers.rows do
      %{^id => %{at_ms: at_ms, beat: beat}} when now_ms - at_ms < @gone_ms -> beat
      _silent -> nil
    end
  end

  @doc "The newest heartbeats of all that are not gone, by name, without this robot's."
  @spec beats(t(), integer()) :: %{atom() => Heartbeat.t()}
  def beats(peers, now_ms) do
    for {id, %{at_ms: at_ms, beat: beat}} <- peers.rows, now_ms - at_ms < @gone_ms, into: %{} do
      {id, beat}
    end
  end

  @doc "The peers as a percept shows them, for the avoidance."
  @spec percepts(t(), integer()) :: %{atom() => Robot.Percept.peer()}
  def percepts(peers, now_ms),
    do: Map.new(peers.rows, fn {id, row} -> {id, percept(row, now_ms)} end)

  @doc "One of them; of a robot that was heard once."
  @spec percept(t(), atom(), integer()) :: Robot.Percept.peer()
  def percept(peers, id, now_ms), do: percept(Map.fetch!(peers.rows, id), now_ms)

  defp percept(%{beat: beat, at_ms: at_ms}, now_ms) do
    {x, y, heading} = beat.pose
    {linear, turn} = beat.twist

    %{
      pose: Pose.new(x / 1000, y / 1000, heading / 1000),
      twist: Twist.new(linear / 1000, turn / 1000),
      radius: beat.radius / 1000,
      at_ms: at_ms,
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
