defmodule Swarm.Agreement.Round do
  @moduledoc """
  Agrees on shared inputs: at the end every member of a view holds the same record, and knows that the others do. Pure;
  time is passed in, in milliseconds.

      collect --all reports-------------------------> digest --all digests equal--> committed
              --the deadline--> echo --200 ms---------^

  No process can know whether its last message arrived, so time-outs give progress and digests
  give safety: each member freezes what it holds, signs it with a digest that is final for the
  round's id, and commits only when it has the same digest from the whole view. A different
  digest, or a member that is gone, opens a new round with a higher id; the highest id heard wins
  everywhere.

  Ids are `{epoch, counter, initiator}`: the epoch is that of the leadership which the round will
  found, the counter grows with each new try.
  """
  alias Swarm.Agreement.Round
  alias Swarm.Agreement.Round.{Epochs, Letter, Precedence, Tally}
  alias Swarm.Wire.CounterGuard

  # Letters are repeated every 100 ms, less often in a large group, because all-to-all traffic
  # grows with its square.
  @repeat_ms 100
  @repeat_ms_per_robot 8
  # How long reports are echoed: before the digest if some are missing, else along with it.
  @echo_ms 200
  # So many, the first of the view, echo them when none is missing.
  @echoing 10
  # Counted in repeats: when to ask for a missing digest, and when to give up a round.
  @ask_after 4
  @give_up_after 25
  # After its commit a member continues to answer, for those that missed the last digest.
  @linger_ms 2_000

  @enforce_keys [:me]
  defstruct @enforce_keys ++
              [
                id: nil,
                view: [],
                phase: :none,
                purpose: :search,
                deadline_ms: 0,
                since_ms: 0,
                said_ms: nil,
                report: :busy,
                reports: %{},
                digests: %{},
                digest: nil,
                echo?: false,
                highest: {0, 0},
                guard: %CounterGuard{}
              ]

  @type phase :: :none | :collect | :echo | :digest | :committed
  @typedoc """
  `report` is this robot's own report, `reports` and `digests` are those heard from all, `said_ms`
  is when this robot last sent a letter, `since_ms` when the phase began, `highest` the highest
  epoch and counter known, `guard` bounds how far others may raise the epoch.
  """
  @type t :: %__MODULE__{
          me: atom(),
          id: Letter.id() | nil,
          view: [atom()],
          phase: phase(),
          purpose: :search | :change,
          deadline_ms: integer(),
          since_ms: integer(),
          said_ms: integer() | nil,
          report: :busy | Swarm.Agreement.Election.report(),
          reports: %{atom() => Swarm.Agreement.Election.report()},
          digests: %{atom() => binary()},
          digest: binary() | nil,
          echo?: boolean(),
          highest: {epoch :: non_neg_integer(), counter :: non_neg_integer()},
          guard: CounterGuard.t()
        }

  @doc "No round yet."
  @spec new(atom()) :: t()
  def new(me), do: %__MODULE__{me: me}

  @doc """
  Opens a round among `view` (which includes the opener), for the leadership of `epoch`. Its
  counter is above any known one.
  """
  @spec open(t(), pos_integer(), [atom()], :search | :change, pos_integer(), integer()) :: t()
  def open(round, epoch, view, purpose, length_ms, now_ms) do
    {epoch, counter} = Precedence.next(epoch, Precedence.fenced(round).highest)
    enter(round, {epoch, counter, round.me}, view, purpose, length_ms, now_ms)
  end

  @doc """
  Sets this robot's report: `:busy` while the scan goes on, then the result, which is final for
  this id.
  """
  @spec report(t(), :busy | Swarm.Agreement.Election.report()) :: t()
  def report(%{phase: :collect, report: :busy} = round, report) when is_map(report),
    do: %{round | report: report, reports: Map.put(round.reports, round.me, report), said_ms: nil}

  def report(round, _report), do: round

  @doc "Whether a round is under way."
  @spec open?(t()) :: boolean()
  def open?(round), do: round.phase in [:collect, :echo, :digest]

  @doc """
  Hears a letter. This robot joins a round with a higher id if it is in the view; a lower one is
  dropped, and so is one whose epoch is not admitted (`.Epochs`).
  """
  @spec hear(t(), atom(), Letter.t(), integer()) :: t()
  def hear(%{me: me} = round, from, %Letter{} = letter, now_ms) when from != me do
    case Epochs.admit_round(round, letter.id, now_ms) do
      {:ok, round} -> round |> Precedence.note(letter.id) |> heed(from, letter, now_ms)
      {:error, _allowed} -> round
    end
  end

  def hear(round, _from, _letter, _now_ms), do: round

  defp heed(round, from, letter, now_ms) do
    cond do
      letter.id == round.id ->
        take(round, from, letter)

      Precedence.supersedes?(letter.id, round) and round.me in letter.view ->
        join(round, from, letter, now_ms)

      true ->
        round
    end
  end

  @doc """
  One tick: returns the letters to send to all of the view, and the outcome, if any.

  `{:commit, record}` is returned once. `{:failed, :mismatch | :timeout}` asks for a new round.
  """
  @spec tick(t(), integer()) ::
          {t(), [Letter.t()], nil | {:commit, Round.Record.t()} | {:failed, :mismatch | :timeout}}
  def tick(%{phase: :none} = round, _now_ms), do: {round, [], nil}

  def tick(round, now_ms) do
    round = advance(round, now_ms)
    {round, letters} = speak(round, now_ms)

    cond do
      round.phase == :digest and Tally.agreed?(round) ->
        {%{round | phase: :committed, since_ms: now_ms}, letters, {:commit, Tally.record(round)}}

      round.phase == :digest and Tally.differing?(round) ->
        {leave(round), letters, {:failed, :mismatch}}

      round.phase == :digest and now_ms - round.since_ms > @give_up_after * repeat_ms(round) ->
        {leave(round), letters, {:failed, :timeout}}

      true ->
        {round, letters, nil}
    end
  end

  @doc "Leaves a round; what this robot said in it remains valid."
  @spec leave(t()) :: t()
  def leave(round), do: %{Precedence.fenced(round) | phase: :none}

  defp enter(round, id, view, purpose, length_ms, now_ms) do
    round
    |> Precedence.note(id)
    |> Map.merge(%{
      id: id,
      view: Enum.sort(view),
      purpose: purpose,
      phase: :collect,
      deadline_ms: now_ms + length_ms,
      since_ms: now_ms,
      said_ms: nil,
      report: :busy,
      reports: %{},
      digests: %{},
      digest: nil,
      echo?: false
    })
  end

  defp join(round, from, letter, now_ms) do
    round
    |> enter(letter.id, letter.view, letter.purpose, max(letter.remaining_ms, 0), now_ms)
    |> take(from, letter)
  end

  # Reports are frozen once the digest is out.
  defp take(round, from, letter) do
    round = if letter.digest, do: Tally.digest(round, from, letter.digest), else: round
    round = if letter.ask, do: %{round | said_ms: nil, echo?: true}, else: round

    if round.phase in [:collect, :echo],
      do: round |> Tally.reports(%{from => letter.report}) |> Tally.reports(letter.known || %{}),
      else: round
  end

  defp advance(%{phase: :collect} = round, now_ms) do
    cond do
      # Not at the tick of its opening: the robot that opened it has to stop first.
      Tally.whole?(round) and now_ms > round.since_ms -> freeze(round, now_ms)
      now_ms < round.deadline_ms -> round
      true -> %{round | phase: :echo, since_ms: now_ms, said_ms: nil, echo?: true}
    end
  end

  defp advance(%{phase: :echo} = round, now_ms) do
    if now_ms - round.since_ms >= @echo_ms,
      do: freeze(round, now_ms),
      else: %{round | echo?: true}
  end

  defp advance(%{phase: :digest} = round, now_ms) when now_ms - round.since_ms < @echo_ms,
    do: %{round | echo?: round.echo? or Tally.whole?(round)}

  defp advance(round, _now_ms), do: round

  defp freeze(round, now_ms) do
    digest = Round.Record.digest(round.id, Round.Record.freeze(round.view, round.reports))

    %{
      round
      | phase: :digest,
        since_ms: now_ms,
        said_ms: nil,
        digest: digest,
        echo?: Tally.whole?(round)
    }
    |> Tally.digest(round.me, digest)
  end

  defp speak(%{phase: :committed} = round, now_ms) do
    if now_ms - round.since_ms <= @linger_ms,
      do: say(round, now_ms),
      else: {round, []}
  end

  defp speak(round, now_ms), do: say(round, now_ms)

  defp say(round, now_ms) do
    if round.said_ms == nil or now_ms - round.said_ms >= repeat_ms(round) do
      letter = %Letter{
        id: round.id,
        view: round.view,
        purpose: round.purpose,
        remaining_ms: round.deadline_ms - now_ms,
        report: round.report,
        known: if(round.echo? and echoes?(round), do: round.reports),
        digest: round.digest,
        ask: round.phase == :digest and now_ms - round.since_ms >= @ask_after * repeat_ms(round)
      }

      {%{round | said_ms: now_ms, echo?: false}, [letter]}
    else
      {round, []}
    end
  end

  # All reports in the letters of all to all would be the cube of a large group. Where reports are missing, each may have
  # one that no other has.
  defp echoes?(%{phase: :echo}), do: true
  defp echoes?(round), do: round.me in Enum.take(round.view, @echoing)

  defp repeat_ms(round), do: max(@repeat_ms, @repeat_ms_per_robot * length(round.view))
end
