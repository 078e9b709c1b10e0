defmodule Missions.Landmark.Transitions do
  @moduledoc """
  Describes the mission as one table: what a robot does in each phase, and which conditions end it. Conditions are
  checked in the order of the row; the first that holds wins. To insert a phase, insert a row. A stop is not in the
  table: it ends the mission from outside, in every phase, and leaves it `:idle`. `:rest`, `:halt` and `:hold` are phases of this
  mission; elsewhere these words mean something else (docs/glossary.md).

  | phase | does | |
  |---|---|---|
  | `:idle` | stands | until it is started |
  | `:search` | turns around once, looking for the landmark, and listens | the thesis's parallel state |
  | `:agree` | stands, having reported, until the round commits | report and collect |
  | `:wander` | goes to the next place to look around (`Lookout`), or roams a little | after a turn in vain |
  | `:rest` | stands | the landmark is nowhere; starts again when it sees one |
  | `:lead` | tracks the landmark, tells the others where the robot is | |
  | `:follow` | drives to its slot, passes the reference on to its child | |
  | `:wait` | stands | too few robots to have a leader |
  | `:halt` | stands | has lost all others, `lost_link: :stop` |
  | `:hold` | goes to the place it was last given | has lost all others, `lost_link: :hold` |

  | condition | holds when |
  |---|---|
  | `:started` | a person has started it |
  | `:elected`, `:led` | a round has made this robot the leader, or another one, or a leader names it in its order |
  | `:nobody`, `:nobody_again` | a round in which no robot had found the landmark; with nothing left to look at, or the third in a row of robots that know no walls |
  | `:more`, `:no_more` | it searches from room to room, turned in vain, and something is left to look at; nothing is |
  | `:scanned` | the turn is over, whatever it showed |
  | `:scan_wanted` | a round waits for a scan that this robot has not made |
  | `:sighted` | the landmark is in the picture, or a round waits for a scan |
  | `:roamed` | it is at the next place to look around, or has roamed for long enough |
  | `:deposed` | others follow a later leader, or no robot hears this one |
  | `:superseded` | a leader of a later epoch names this robot in its order |
  | `:round_open` | a round is under way |
  | `:lost_stop`, `:lost_hold` | it has lost all others, and this is what it does then (`Policy`) |
  | `:company` | it hears another robot |
  | `:short`, `:enough` | there are too few robots to have a leader; not too few |
  """

  @table [
    idle: {:stand, started: :search},
    search:
      {:scan,
       elected: :lead,
       led: :follow,
       nobody_again: :rest,
       nobody: :wander,
       lost_stop: :halt,
       lost_hold: :hold,
       short: :wait,
       more: :wander,
       no_more: :rest,
       scanned: :agree},
    agree:
      {:stand,
       elected: :lead,
       led: :follow,
       nobody_again: :rest,
       nobody: :wander,
       lost_stop: :halt,
       lost_hold: :hold,
       short: :wait,
       scan_wanted: :search},
    wander:
      {:roam,
       led: :follow,
       lost_stop: :halt,
       lost_hold: :hold,
       short: :wait,
       sighted: :search,
       no_more: :rest,
       roamed: :search},
    rest:
      {:stand, led: :follow, lost_stop: :halt, lost_hold: :hold, short: :wait, sighted: :search},
    lead: {:lead, lost_stop: :halt, lost_hold: :hold, deposed: :agree, round_open: :agree},
    follow:
      {:follow,
       lost_stop: :halt, lost_hold: :hold, round_open: :agree, superseded: :agree, short: :wait},
    wait: {:stand, led: :follow, round_open: :agree, enough: :agree},
    halt: {:stand, led: :follow, company: :agree},
    hold: {:hold, led: :follow, company: :agree}
  ]

  @type phase ::
          :idle
          | :search
          | :agree
          | :wander
          | :rest
          | :lead
          | :follow
          | :wait
          | :halt
          | :hold
  @type activity :: :stand | :scan | :roam | :lead | :follow | :hold
  @type condition ::
          :started
          | :elected
          | :led
          | :nobody
          | :nobody_again
          | :more
          | :no_more
          | :scanned
          | :scan_wanted
          | :sighted
          | :roamed
          | :deposed
          | :superseded
          | :round_open
          | :lost_stop
          | :lost_hold
          | :company
          | :short
          | :enough

  @doc "The phases in the order of the table."
  @spec phases() :: [phase()]
  def phases, do: Keyword.keys(@table)

  @doc """
  What a robot does in a phase.

      iex> Missions.Landmark.Transitions.activity(:search)
      :scan
  """
  @spec activity(phase()) :: activity()
  def activity(phase), do: @table |> Keyword.fetch!(phase) |> elem(0)

  @doc """
  The phase that follows, given what holds.

      iex> Missions.Landmark.Transitions.next(:agree, &(&1 == :led))
      :follow
      iex> Missions.Landmark.Transitions.next(:rest, fn _ -> false end)
      :rest
  """
  @spec next(phase(), (condition() -> boolean())) :: phase()
  def next(phase, holds?) do
    {_activity, exits} = Keyword.fetch!(@table, phase)
    Enum.find_value(exits, phase, fn {condition, next} -> holds?.(condition) && next end)
  end
end
