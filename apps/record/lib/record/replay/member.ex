defmodule Record.Replay.Member do
  @moduledoc """
  Replays a recorded robot: it gets the inputs again that it had, in their order, and must have the
  same effects. Pure.

  A robot knows nothing of a world: its inputs are what sensors, others and people told it. So its
  recording replays without a simulator, and after a change of the code shows where the robot
  would have decided otherwise.
  """
  alias Robot.Control.Controller
  alias Robot.Mission.Runner
  alias Swarm.Member

  @typedoc "What a robot did, and what it does now on the same input, with the same past."
  @type difference :: %{
          robot: atom(),
          at_ms: integer(),
          input: Member.input(),
          recorded: [Member.effect()],
          replayed: [Member.effect()]
        }

  @doc "Gives a robot one recorded input, and compares its effects with the recorded ones."
  @spec step(Member.t(), Member.input(), recorded :: [Member.effect()]) ::
          {Member.t(), difference() | nil}
  def step(member, input, recorded) do
    case again(member, input) do
      {member, ^recorded} ->
        {member, nil}

      {member, replayed} ->
        {member,
         %{
           robot: Member.id(member),
           at_ms: at_ms(input),
           input: input,
           recorded: recorded,
           replayed: replayed
         }}
    end
  end

  # A recording holds no answers to people.
  defp again(member, input) do
    {member, effects} = Member.step(member, input)
    {member, Enum.reject(effects, &match?({:reply, _answer}, &1))}
  end

  @typedoc """
  Why a robot did at one tick what it did: what it perceived, the wishes of its behaviours by the
  weights with which they were compared (the chosen one first), what the gate let through of it
  and by which limits, the mission's own words before and after, and the effects of the tick. Of
  robots of processes the last order of a person, too.
  """
  @type reasons :: %{
          :percept => Robot.Percept.t(),
          :wishes => [{Robot.Wish.t(), weight :: float()}],
          :driving => %{twist: Hal.Twist.t(), limits: [atom()]} | nil,
          :stopped? => boolean(),
          :before => [{String.t(), String.t()}],
          :mission => [{String.t(), String.t()}],
          :effects => [Member.effect()],
          optional(:order) => Record.Replay.LastOrder.t() | nil
        }

  @doc """
  The reasons for what a robot did on the input `{:tick, at_ms}`, from the robot as it was before
  the tick, and the inputs that it had from there on, up to the gate's next step.
  """
  @spec reasons(Member.t(), [Member.input()]) :: reasons()
  def reasons(%Member{} = before, [{:tick, at_ms} | _] = inputs) do
    percept = Member.percept(before, at_ms)

    {member, effects} =
      Enum.reduce(inputs, {before, []}, fn input, {member, effects} ->
        {member, more} = again(member, input)
        {member, effects ++ more}
      end)

    %{
      percept: Controller.percept(Member.role(member, :executive).controller),
      wishes: Controller.wishes(Member.role(before, :executive).controller, percept),
      driving: with({driving, _at_ms} <- member.lockstep.board[:driving], do: driving),
      stopped?: Member.held(member) != nil,
      before: Runner.explain(Member.runner(before)),
      mission: Runner.explain(Member.runner(member)),
      effects: effects
    }
  end

  @doc """
  When an input came, in ms.

      iex> Record.Replay.Member.at_ms({:tick, 300})
      300
      iex> Record.Replay.Member.at_ms({:command, :start, 0})
      0
  """
  @spec at_ms(Member.input()) :: integer()
  def at_ms({:detections, detections}), do: detections.at_ms
  def at_ms({_kind, at_ms}), do: at_ms
  def at_ms({_kind, _what, at_ms}), do: at_ms
end
