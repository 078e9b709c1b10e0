defmodule Lab.MissionCase do
  @moduledoc """
  Runs any mission in lockstep and says what does not hold that must hold for all. For tests:

      test "what holds for every mission" do
        assert Lab.MissionCase.problems({Mine.Roll, speed: 0.2}) == []
      end

  Each seed is a fleet of its own, with the loss of messages that is its turn; a robot dies in the middle of the run. Then

  | must hold | is looked at by |
  |---|---|
  | the same seed gives the same bytes | all inputs and effects of all robots, in two runs |
  | what it sends is whole | `Swarm.Message.check/1` of every message, heartbeats with its claims too |
  | junk from others changes nothing | terms that are no messages, letters of other missions and versions |
  | its own letters, spoilt, do not end it | fields that are missing, and values of other types |
  | its state is bounded | its size at the end, and in the middle |
  | what it draws is drawn | each part of its layer, once a second |
  | it stops when told, and starts again | phases; true poses |
  | what it names itself | `always:`, asked each second |

  A mission that raises ends the test with its own error. Pure, but for loading the mission.
  """
  alias Hal.{Options, Pose}
  alias Robot.Mission.{Letter, Runner}
  alias Lab.{Run, Trial}
  alias Sim.World
  alias Swarm.{Member, Message, MissionRegistry}

  @settle_ms 3_000
  @rest_ms 5_000
  # How far a body may roll in the 5 s after that, metres.
  @still_m 0.02

  @doc """
  What does not hold, one line each. Options: `robots` (`[:mag1, :mag2, :min1]`), `seeds` (`1..3`), `loss` (a share of the messages for
  each seed in turn, `[0.0, 0.2]`), `seconds` (40), `words` (how large the mission's state may be, 200,000), `always` (a
  function of a `Lab.Trial` that returns `:ok` or a line), `trial` (more options of `Lab.Trial.Setup.new/1`). Raises `ArgumentError` for a mission or
  options that are wrong.
  """
  @spec problems(MissionRegistry.named(), keyword()) :: [String.t()]
  def problems(mission, options \\ []) do
    options = Options.check!(options, table(), "mission case")

    mission =
      case MissionRegistry.choose(mission, length(options[:robots])) do
        {:ok, mission} -> mission
        {:error, line} -> raise ArgumentError, line
      end

    options[:seeds]
    |> Enum.with_index()
    |> Enum.flat_map(fn {seed, n} ->
      loss = Enum.at(options[:loss], rem(n, length(options[:loss])))
      for line <- of_seed(mission, seed, loss, options), do: "seed #{seed}, loss #{loss}: #{line}"
    end)
    |> Enum.uniq()
  end

  defp table do
    [
      robots: [{:check, &is_list/1, "a list of robots"}, default: [:mag1, :mag2, :min1]],
      seeds: [{:check, &(Enum.count(&1) > 0), "seeds, 1..3,"}, default: 1..3],
      loss: [{:list, {:number, 0, 1}}, default: [0.0, 0.2]],
      seconds: [{:integer, 4, 3_600, "s"}, default: 40],
      words: [{:integer, 1, 1_000_000_000, "words"}, default: 200_000],
      always: [{:check, &is_function(&1, 1), "a function of a trial"}, default: fn _ -> :ok end],
      trial: [{:check, &Keyword.keyword?/1, "[key: value, …]"}, default: []]
    ]
  end

  defp of_seed(mission, seed, loss, options) do
    {:ok, setup} =
      [mission: mission, robots: options[:robots], seed: seed, loss: loss, blobs: :direct]
      |> Keyword.merge(duration_s: 1_000_000)
      |> Keyword.merge(options[:trial])
      |> Map.new()
      |> Trial.setup()

    first = run(setup, options)
    again = run(setup, options)

    same =
      if first.digest == again.digest,
        do: [],
        else: ["the second run of the same seed was another"]

    same ++ first.wrong ++ junk(first) ++ stop(first.trial, mission)
  end

  # The end of a run with the digest of all that went in and out, its letters, and what was wrong.
  defp run(setup, options) do
    half_ms = options[:seconds] * 500
    seen = %{digest: 0, letters: [], wrong: []}
    {middle, seen} = setup |> Trial.begin(record: true) |> follow(seen, half_ms, options)
    killed? = length(options[:robots]) > 1
    killed = if killed?, do: Trial.kill(middle, List.last(options[:robots])), else: middle
    {last, seen} = follow(killed, seen, 2 * half_ms, options)
    wrong = Enum.uniq(seen.wrong ++ sizes(middle, last, options[:words]))
    Map.merge(seen, %{trial: %{last | entries: nil}, wrong: wrong})
  end

  defp follow(trial, seen, until_ms, options) do
    over? = &(Run.at_ms(&1) >= until_ms)
    {run, seen} = trial |> Run.new() |> Run.fold(seen, over?, &tick(&1, &2, &3, options))
    {run.source, seen}
  end

  defp tick(_before, run, seen, options) do
    {entries, trial} = Trial.take_entries(run.source)

    sent =
      for {:step, _id, _input, effects} <- entries, {:send, _to, message} <- effects, do: message

    broken =
      for message <- sent,
          {:error, kind} <- [Message.check(message)],
          do: "it sends a #{kind} that is not whole"

    always =
      if rem(trial.at_ms, 1_000) == 0,
        do: named(options[:always].(trial)) ++ undrawable(trial),
        else: []

    letters = for %Message{kind: :mission, body: letter} <- sent, do: letter

    seen = %{
      digest: :erlang.phash2({seen.digest, entries}),
      letters: Enum.take(letters ++ seen.letters, 20),
      wrong: seen.wrong ++ broken ++ always
    }

    {%{run | source: trial}, seen}
  end

  # What is drawn of a mission is asked for by each view (`t:Robot.Mission.layer/0`).
  defp undrawable(trial) do
    for {_id, %{layer: layer}} <- Trial.claims(trial),
        part <- layer,
        not drawable?(part),
        do: "its layer has #{inspect(part, limit: 8)}, which is not drawn"
  end

  defp drawable?({:polyline, name, points}), do: is_binary(name) and Enum.all?(points, &place?/1)

  defp drawable?({:cells, name, size, points}),
    do: is_binary(name) and is_number(size) and Enum.all?(points, &place?/1)

  defp drawable?({:points, name, points}) do
    is_binary(name) and
      Enum.all?(
        points,
        &match?({x, y, label} when is_number(x) and is_number(y) and is_binary(label), &1)
      )
  end

  defp drawable?(_other), do: false

  defp place?({x, y}), do: is_number(x) and is_number(y)
  defp place?(_other), do: false

  defp named(:ok), do: []
  defp named(line), do: [line]

  defp sizes(middle, last, words) do
    before = state_words(middle)

    for {id, size} <- state_words(last),
        size > words or size > 1.5 * before[id] + 2_000,
        do: "the state of #{id} grows: #{before[id]} words in the middle, #{size} at the end"
  end

  defp state_words(trial),
    do:
      for(
        id <- Trial.living(trial),
        into: %{},
        do: {id, :erts_debug.flat_size(mission_of(trial, id))}
      )

  defp mission_of(trial, id), do: Member.runner(Trial.robot(trial, id)).mission

  defp junk(%{trial: trial, letters: letters}) do
    [id | _] = Trial.living(trial)
    member = Trial.robot(trial, id)
    foreign = %Letter{to: :all, mission: __MODULE__, version: 1, kind: :junk, fields: [junk: 1]}
    others = [foreign | for(letter <- letters, do: %{letter | version: letter.version + 1})]

    changed =
      for term <- [:junk, {:message, 1}, %{from: :mag2}, nil] ++ Enum.map(others, &said/1),
          {heard, effects} = Member.step(member, {:message, term, trial.at_ms}),
          Member.runner(heard).mission != Member.runner(member).mission or effects != [],
          do: "#{inspect(term, limit: 8)} from another robot changes it"

    # Some of these may be allowed; they must not end it.
    for letter <- letters,
        spoilt <- spoil(letter),
        do: Member.step(member, {:message, said(spoilt), trial.at_ms})

    changed
  end

  defp said(letter), do: Message.new(:mag99, :mission, letter)

  defp spoil(%{fields: fields} = letter) do
    for {key, _value} <- fields,
        changed <- [
          Keyword.delete(fields, key)
          | for(
              junk <- [nil, :junk, -1, 1.0e300, [1 | 2], %{}],
              do: Keyword.put(fields, key, junk)
            )
        ],
        do: %{letter | fields: changed}
  end

  defp stop(trial, {module, _options}) do
    stopped = trial |> Trial.command(:all, :stop) |> later(@settle_ms)
    rested = later(stopped, @rest_ms)

    states =
      for id <- Trial.living(rested),
          do: {id, Runner.state(Member.runner(Trial.robot(rested, id)))}

    running =
      for {id, state} <- states, state != :idle, do: "#{id} is #{inspect(state)} after a stop"

    moving =
      for id <- Trial.living(rested),
          moved = Pose.distance(World.truth(stopped.world, id), World.truth(rested.world, id)),
          moved > @still_m,
          do: "#{id} moves after a stop"

    begun = rested |> Trial.command(:all, :start) |> later(@settle_ms)

    idle =
      for id <- Trial.living(begun),
          not match?({^module, _phase}, Runner.state(Member.runner(Trial.robot(begun, id)))),
          do: "#{id} does not start again"

    running ++ moving ++ idle
  end

  defp later(%{at_ms: from_ms} = trial, ms), do: Run.play(trial, &(&1.at_ms >= from_ms + ms))
end
