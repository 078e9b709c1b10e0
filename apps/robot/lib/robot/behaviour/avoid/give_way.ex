defmodule Robot.Behaviour.Avoid.GiveWay do
  @moduledoc false
  # Gives way: a robot that stands may block another's path. If another robot that does not hold its
  # place stays close for some seconds, this one steps aside for a moment. Pure.
  #
  # The threshold is meant to be below the spacing of a formation, so that neighbours in a formation
  # do not make each other step aside.
  alias Hal.Pose
  alias Robot.Behaviour.Avoid.Neighbours

  @enforce_keys [:id, :since_ms]
  defstruct @enforce_keys ++ [until_ms: nil, direction: nil]

  @type t :: %__MODULE__{
          id: atom(),
          since_ms: integer(),
          until_ms: integer() | nil,
          direction: {float(), float()} | nil
        }

  # Bodies with a smaller gap (metres) are too close to be neighbours in a formation.
  @close 0.2
  @patience_ms 4000
  @step_ms 2500
  # For this long after stepping aside, a robot does not step aside again.
  @again_ms 9000

  @doc "The direction (a unit vector) in which to step aside now, or `nil`, and the next state."
  @spec note(t() | nil, [Neighbours.t()], Pose.t(), integer()) ::
          {{float(), float()} | nil, t() | nil}
  def note(%{until_ms: until_ms} = yield, _robots, _pose, at_ms)
      when until_ms != nil and at_ms < until_ms,
      do: {yield.direction, yield}

  def note(%{until_ms: until_ms} = yield, _robots, _pose, at_ms)
      when until_ms != nil and at_ms < until_ms + @again_ms,
      do: {nil, yield}

  def note(yield, robots, pose, at_ms) do
    case {Enum.find(robots, &(not &1.fixed? and &1.gap < @close)), yield} do
      {nil, _yield} ->
        {nil, nil}

      {%{id: id} = robot, %{id: id, until_ms: nil} = yield} ->
        if at_ms - yield.since_ms >= @patience_ms,
          do: aside(%{yield | until_ms: at_ms + @step_ms}, robot, pose),
          else: {nil, yield}

      {%{id: id}, _other} ->
        {nil, %__MODULE__{id: id, since_ms: at_ms}}
    end
  end

  @doc "Whether the robot is stepping aside at this time."
  @spec now?(t() | nil, integer()) :: boolean()
  def now?(%{until_ms: until_ms}, at_ms) when until_ms != nil, do: at_ms < until_ms
  def now?(_yield, _at_ms), do: false

  defp aside(yield, %{at: {x, y}}, pose) do
    distance = max(Pose.distance(pose, {x, y}), 0.01)
    direction = {(pose.x - x) / distance, (pose.y - y) / distance}
    {direction, %{yield | direction: direction}}
  end
end
