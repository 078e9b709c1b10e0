defmodule Record.Replay.Moment do
  @moduledoc """
  Describes what a replayed robot did last, and from what: kept during a replay, for people who ask why
  (`mix replay --why`). Pure.
  """
  alias Robot.Control.{Controller, Executive, Pilot}
  alias Robot.Mission.Runner
  alias Record.Replay.LastOrder

  defstruct at_ms: nil,
            tick: nil,
            driving: nil,
            mission: nil,
            stopped?: false,
            effects: [],
            order: nil

  @typedoc """
  `tick` is the controller before the last tick with the raw percept; `mission` the runner before
  and after its last tick; `effects` those of executive and pilot since, newest first, at most some; `order` is the last one.
  """
  @type t :: %__MODULE__{
          at_ms: integer() | nil,
          tick: {Controller.t(), Robot.Percept.t()} | nil,
          driving: %{twist: Hal.Twist.t(), limits: [atom()]} | nil,
          mission: {before :: Runner.t(), Runner.t()} | nil,
          stopped?: boolean(),
          effects: [term()],
          order: LastOrder.t() | nil
        }

  @most 100

  @doc "Notes an entry of a role that has changed its part of the replay."
  @spec note(t() | nil, atom(), {atom(), term(), integer()}, map(), map()) :: t()
  def note(moment, role, entry, before, after_it) do
    moment = moment || %__MODULE__{}

    noted(
      %{moment | order: LastOrder.note(moment.order, role, entry, before, after_it)},
      role,
      entry,
      before,
      after_it
    )
  end

  defp noted(
         moment,
         :executive,
         {:input, {:tick, raw}, at_ms},
         %{state: %Executive{controller: controller}},
         _after_it
       ),
       do: %{moment | at_ms: at_ms, tick: {controller, raw}, effects: []}

  defp noted(
         moment,
         :pilot,
         {:input, {:cast, {:tick, _percept}}, _at_ms},
         %{state: %Pilot{runner: before}},
         %{state: %Pilot{runner: runner}}
       ),
       do: %{moment | mission: {before, runner}}

  defp noted(moment, :gate, {:effect, {:drive, twist, limits}, _at_ms}, _before, _after_it),
    do: %{moment | driving: %{twist: twist, limits: limits}, stopped?: :estop in limits}

  defp noted(moment, role, {:effect, effect, _at_ms}, _before, _after_it)
       when role in [:executive, :pilot],
       do: %{moment | effects: Enum.take([effect | moment.effects], @most)}

  defp noted(moment, _role, _entry, _before, _after_it), do: moment

  @doc """
  The reasons for the last tick: what was perceived, all wishes with their weights, the chosen one
  first, what the gate let through, and the mission's words before and after. `nil` before a tick.
  """
  @spec reasons(t()) :: map() | nil
  def reasons(%__MODULE__{tick: nil}), do: nil

  def reasons(%__MODULE__{tick: {controller, raw}} = moment) do
    {_wish, _outcome, then} = Controller.tick(controller, raw)
    {before, mission} = moment.mission || {nil, nil}

    %{
      percept: Controller.percept(then),
      wishes: Controller.wishes(controller, raw),
      driving: moment.driving,
      stopped?: moment.stopped?,
      order: moment.order,
      before: explain(before),
      mission: explain(mission),
      effects: effects(moment)
    }
  end

  defp explain(nil), do: []
  defp explain(runner), do: Runner.explain(runner)

  # What others, the head and people notice; the wish and the percept are told above.
  defp effects(moment) do
    moment.effects
    |> Enum.reverse()
    |> Enum.flat_map(fn
      {:look, pan} when is_number(pan) -> [{:look, pan, 0.0}]
      {:send, _to, _message} = sent -> [sent]
      {:stage, _name, _facts} = stage -> [stage]
      _inside -> []
    end)
    |> Enum.uniq()
  end

  @doc "The parts of two states that differ, each side by the names of the parts."
  @spec parted(Robot.Trace.state(), Robot.Trace.state()) :: {keyword(), keyword()}
  def parted(one, other) do
    keys =
      for {key, value} <- Enum.sort(Map.from_struct(one)),
          Map.get(other, key) !== value,
          do: key

    {for(k <- keys, do: {k, Map.get(one, k)}), for(k <- keys, do: {k, Map.get(other, k)})}
  end
end
