defmodule Sim.Replay do
  @moduledoc """
  Replays a recorded run, tick by tick: each robot by what it was told (`Swarm.Replay`), and the
  world by what the robots did and who intervened. Both must be as recorded. Pure.

  The radio is not replayed: what it delivered is among the robots' inputs. The world is: the
  readings of sensors are made again, and a picture is painted again and searched for blobs, or
  seen by geometry, as in the run. So a replay is a trial at each of its ticks, for whoever wants
  to see it (`trial/1`).
  """
  alias Sim.{Radio, Recording, Trial}
  alias Sim.Trial.{Mechanics, Setup}

  @enforce_keys [:trial]
  defstruct @enforce_keys ++ [inputs: 0, stage: :events]

  @typedoc """
  `inputs` counts what the robots were told. A tick has three stages: its events, what the robots
  do until the fleet is looked at, and the rest, in which the world goes on.
  """
  @type t :: %__MODULE__{
          trial: Trial.t(),
          inputs: non_neg_integer(),
          stage: :events | :robots | :world
        }

  @typedoc """
  Where the replay differs: in what a robot did on the same input, or in what its sensors told it.
  """
  @type difference ::
          {:decision, Swarm.Replay.difference()}
          | {:world, %{robot: atom(), at_ms: integer(), recorded: term(), replayed: term() | nil}}
          | {:unknown, robot :: atom(), at_ms :: integer()}

  @doc "The start of a replay."
  @spec new(Setup.t()) :: t()
  def new(%Setup{} = setup), do: %__MODULE__{trial: Trial.still(setup)}

  @doc "The run as it was at the end of the last tick."
  @spec trial(t()) :: Trial.t()
  def trial(%__MODULE__{trial: trial}), do: trial

  @doc "Replays one tick, and returns where it differs, in order."
  @spec step(t(), Recording.tick()) :: {t(), [difference()]}
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
    at_ms = Swarm.Replay.at_ms(input)
    replay = replay |> advance(at_ms) |> settle(input)
    {trial, decided} = decide(replay.trial, id, input, effects, at_ms)
    differences = decided ++ sensed(replay.trial, id, input, at_ms) ++ differences
    {%{replay | trial: trial, inputs: replay.inputs + 1}, differences}
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
        {member, difference} = Swarm.Replay.step(member, input, recorded)
        trial = %{trial | members: %{trial.members | id => member}}
        trial = Enum.reduce(recorded, trial, &Mechanics.effect(&1, id, &2))
        {trial, for(difference <- List.wrap(difference), do: {:decision, difference})}

      _dead_or_unknown ->
        {trial, [{:unknown, id, at_ms}]}
    end
  end

  defp sensed(trial, id, input, at_ms) do
    case input do
      {:reading, {key, _value} = reading, _at_ms} ->
        same(reading, List.keyfind(Mechanics.readings(trial, id), key, 0), id, at_ms)

      {:detections, detections} ->
        same(detections, Mechanics.detections(trial, id), id, at_ms)

      _not_of_the_world ->
        []
    end
  end

  defp same(recorded, recorded, _id, _at_ms), do: []

  defp same(recorded, replayed, id, at_ms),
    do: [{:world, %{robot: id, at_ms: at_ms, recorded: recorded, replayed: replayed}}]
end
