defmodule Lab.Replay do
  @moduledoc """
  Replays a recorded run, tick by tick: each robot by what it was told (`Record.Replay.Member`), and the
  world by what the robots did and by interventions. Both must be as recorded. Pure.

  The radio is not replayed: what it delivered is among the robots' inputs. The world is: the
  readings of sensors are made again, and a picture is painted again and searched for blobs, or
  seen by geometry, as in the run. So a replay is a trial at each of its ticks, for a caller that wants
  to see it (`trial/1`).
  """
  @behaviour Lab.Replay.Kind
  alias Robot.Mission.Runner
  alias Lab.{Recording, Trial}
  alias Sim.Radio
  alias Lab.Trial.{Mechanics, Setup}
  alias Swarm.Member

  @enforce_keys [:trial]
  defstruct @enforce_keys ++ [inputs: 0, decisions: 0, stage: :events]

  @typedoc """
  `inputs` counts what the robots were told, `decisions` their effects that are as recorded. A tick has three stages: its events, what the robots
  do until the fleet is looked at, and the rest, in which the world goes on.
  """
  @type t :: %__MODULE__{
          trial: Trial.t(),
          inputs: non_neg_integer(),
          decisions: non_neg_integer(),
          stage: :events | :robots | :world
        }

  @doc "The start of a replay."
  @spec new(Setup.t()) :: t()
  def new(%Setup{} = setup), do: %__MODULE__{trial: Trial.still(setup)}

  @doc "The run as it was at the end of the last tick."
  @spec trial(t()) :: Trial.t()
  def trial(%__MODULE__{trial: trial}), do: trial

  @impl Lab.Replay.Kind
  def step(%__MODULE__{} = replay, {at_ms, entries}) do
    {replay, differences} = Enum.reduce(entries, {%{replay | stage: :events}, []}, &entry/2)
    {advance(replay, at_ms), Enum.reverse(differences)}
  end

  defp entry({:world, at_ms, event}, {replay, differences}) do
    %{trial: trial} = replay = advance(replay, at_ms)
    # The commands that are part of it are among the robots' inputs.
    {trial, _commands} = Trial.happen(trial, event)
    {%{replay | trial: trial}, differences}
  end

  defp entry({:step, id, input, effects}, {replay, differences}) do
    at_ms = Record.Replay.Member.at_ms(input)
    replay = replay |> advance(at_ms) |> settle(input)
    {trial, decided} = decide(replay.trial, id, input, effects, at_ms)
    {sensed, trial} = sensed(trial, replay.trial, id, input, at_ms)
    differences = decided ++ sensed ++ differences
    same = if decided == [], do: length(effects), else: 0
    counts = %{inputs: replay.inputs + 1, decisions: replay.decisions + same}
    {Map.merge(%{replay | trial: trial}, counts), differences}
  end

  # Commands are given along with the events, before what these change is put into effect.
  defp settle(%{stage: :events} = replay, {:command, _command, _at_ms}), do: replay

  defp settle(%{stage: :events, trial: trial} = replay, _input),
    do: %{replay | trial: Mechanics.settle(trial), stage: :robots}

  defp settle(replay, _input), do: replay

  # The world is as far as the newest input.
  defp advance(%{trial: %{at_ms: now_ms}} = replay, at_ms) when now_ms >= at_ms, do: replay

  defp advance(%{stage: :world, trial: trial} = replay, at_ms),
    do: advance(%{replay | trial: Mechanics.act(trial)}, at_ms)

  defp advance(replay, at_ms) do
    %{trial: trial} = settle(replay, nil)
    # What the radio delivers is among the robots' inputs.
    {_letters, radio} = Radio.receive(trial.radio, trial.at_ms)
    trial = Mechanics.observe(%{trial | radio: radio})
    advance(%{replay | trial: trial, stage: :world}, at_ms)
  end

  defp decide(trial, id, input, recorded, at_ms) do
    case trial.members do
      %{^id => member} ->
        {member, difference} = Record.Replay.Member.step(member, input, recorded)
        trial = %{trial | members: %{trial.members | id => member}}
        trial = Enum.reduce(recorded, trial, &Mechanics.effect(&1, id, &2))
        {trial, for(difference <- List.wrap(difference), do: {:decision, difference})}

      _dead_or_unknown ->
        {trial, [{:unknown, id, at_ms}]}
    end
  end

  # By the world before the robot decided.
  defp sensed(decided, before, id, input, at_ms) do
    case input do
      {:reading, {key, _value} = reading, _at_ms} ->
        {same(reading, List.keyfind(Mechanics.readings(before, id), key, 0), id, at_ms), decided}

      {:detections, detections} ->
        {seen, %{schedules: schedules}} = Mechanics.look(before, id)
        {same(detections, seen, id, at_ms), %{decided | schedules: schedules}}

      _not_of_the_world ->
        {[], decided}
    end
  end

  defp same(recorded, recorded, _id, _at_ms), do: []

  defp same(recorded, replayed, id, at_ms),
    do: [{:world, %{robot: id, at_ms: at_ms, recorded: recorded, replayed: replayed}}]

  @impl Lab.Replay.Kind
  def finish(%__MODULE__{} = replay), do: {replay, []}

  @impl Lab.Replay.Kind
  def at_ms(%__MODULE__{trial: trial}), do: trial.at_ms

  @impl Lab.Replay.Kind
  def stages(%__MODULE__{trial: trial}), do: Trial.stages(trial)

  @impl Lab.Replay.Kind
  def scene(%__MODULE__{trial: trial}), do: Trial.scene(trial)

  # Readings and messages came to the robot before it decided; then came the gate's next step.
  @impl Lab.Replay.Kind
  def reasons(%__MODULE__{}, %__MODULE__{trial: before}, {_at_ms, entries}, id) do
    inputs = for {:step, ^id, input, _effects} <- entries, do: input
    member = Trial.robot(before, id)

    case Enum.split_while(inputs, &(not match?({:tick, _at_ms}, &1))) do
      {first, [{:tick, at_ms} | _] = decided} when member != nil ->
        member = Enum.reduce(first, member, &elem(Member.step(&2, &1), 0))
        {at_ms, Record.Replay.Member.reasons(member, Enum.take(decided, 2))}

      _dead_or_frozen ->
        nil
    end
  end

  @impl Lab.Replay.Kind
  def doing(%__MODULE__{trial: trial}, id) do
    with %Member{} = member <- Trial.robot(trial, id) do
      mission = with {mission, _phase} <- Runner.state(Member.runner(member)), do: mission
      driving = with {driving, _at_ms} <- member.lockstep.board[:driving], do: driving
      %{mission: mission, driving: driving, known_ms: trial.at_ms}
    else
      nil -> %{mission: nil, driving: nil, known_ms: nil}
    end
  end

  @impl Lab.Replay.Kind
  def compared(%__MODULE__{} = replay) do
    %{
      parts: [],
      inputs: replay.inputs,
      decisions: replay.decisions,
      lost: 0,
      skipped: 0,
      world?: true
    }
  end

  @impl Lab.Replay.Kind
  def facts(%__MODULE__{}, {_at_ms, entries}), do: Recording.Facts.of(entries)

  @impl Lab.Replay.Kind
  def messages(%__MODULE__{}, {_at_ms, entries}), do: Lab.Messages.of_entries(entries)
end
