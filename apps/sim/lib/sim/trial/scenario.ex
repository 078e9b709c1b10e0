defmodule Sim.Trial.Scenario do
  @moduledoc """
  Scheduled interventions in a run, such as moves of the landmark and kills. Pure; times in
  milliseconds.
  """

  @enforce_keys [:pending]
  defstruct @enforce_keys ++ [last_ms: 0]

  @type event :: {:move, Hal.Pose.point()} | {:kill, :leader | atom()}
  @type t :: %__MODULE__{pending: [{at_ms :: integer(), event()}], last_ms: integer()}

  @doc "A script of moves `{{x, y}, at_s}` and kills `{who, at_s}`."
  @spec new([{Hal.Pose.point(), number()}], [{atom(), number()}]) :: t()
  def new(moves, kills) do
    events =
      for({place, at_s} <- moves, do: {round(at_s * 1000), {:move, place}}) ++
        for {who, at_s} <- kills, do: {round(at_s * 1000), {:kill, who}}

    %__MODULE__{pending: Enum.sort(events)}
  end

  @doc "Adds a move."
  @spec add_move(t(), Hal.Pose.point(), integer()) :: t()
  def add_move(script, place, at_ms), do: add(script, {at_ms, {:move, place}})

  @doc "Adds a kill."
  @spec add_kill(t(), atom(), integer()) :: t()
  def add_kill(script, who, at_ms), do: add(script, {at_ms, {:kill, who}})

  defp add(script, event), do: %{script | pending: Enum.sort([event | script.pending])}

  @doc "The interventions that are due. Killing the leader waits until there is one."
  @spec due(t(), integer(), leader :: atom() | nil) ::
          {[{:move, Hal.Pose.point()} | {:kill, atom()}], t()}
  def due(script, now_ms, leader) do
    {due, pending} =
      Enum.split_with(script.pending, fn {at_ms, event} ->
        at_ms <= now_ms and (event != {:kill, :leader} or leader != nil)
      end)

    events = for {_at_ms, event} <- due, do: name(event, leader)
    last_ms = if due == [], do: script.last_ms, else: now_ms
    {events, %{script | pending: pending, last_ms: last_ms}}
  end

  @doc "Whether no interventions are left, and the landmark stands still."
  @spec over?(t(), Sim.World.t()) :: boolean()
  def over?(script, world), do: script.pending == [] and world.goal == nil

  @doc "When the last intervention happened."
  @spec last_ms(t()) :: integer()
  def last_ms(script), do: script.last_ms

  defp name({:kill, :leader}, leader), do: {:kill, leader}
  defp name(event, _leader), do: event
end
