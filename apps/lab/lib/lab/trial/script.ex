defmodule Lab.Trial.Script do
  @moduledoc """
  Describes what is done to a run and when: moves of the landmark, kills, and all other events
  (`Lab.Trial.Event`). Pure; times in milliseconds.
  """
  alias Lab.Trial.Event

  @enforce_keys [:pending]
  defstruct @enforce_keys ++ [last_ms: 0]

  @type t :: %__MODULE__{pending: [{at_ms :: integer(), Event.t()}], last_ms: integer()}

  @doc """
  A script of moves `{{x, y}, at_s}`, kills `{who, at_s}` and events `{at_s, event}`. Of those at
  the same time, kills come first, then moves, then the events in the order in which they are
  given.
  """
  @spec new([{Hal.Pose.point(), number()}], [{atom(), number()}], [Event.entry()]) :: t()
  def new(moves, kills, events \\ []) do
    old =
      for({place, at_s} <- moves, do: {ms(at_s), {:move, place}}) ++
        for {who, at_s} <- kills, do: {ms(at_s), {:kill, who}}

    put(%__MODULE__{pending: Enum.sort(old)}, for({at_s, event} <- events, do: {ms(at_s), event}))
  end

  @doc "Adds an event."
  @spec add(t(), integer(), Event.t()) :: t()
  def add(script, at_ms, event), do: put(script, [{at_ms, event}])

  defp put(script, events),
    do: %{script | pending: Enum.sort_by(script.pending ++ events, &elem(&1, 0))}

  @doc """
  The events that are due, with the leader's name for `:leader`; an event for the leader waits
  until there is one.

      iex> script = Lab.Trial.Script.new([], [{:leader, 2}], [{2, {:estop, :mag1}}])
      iex> {[{:estop, :mag1}], script} = Lab.Trial.Script.due(script, 2_000, nil)
      iex> {[{:kill, :min3}], script} = Lab.Trial.Script.due(script, 2_100, :min3)
      iex> {script.pending, Lab.Trial.Script.last_ms(script)}
      {[], 2_100}
  """
  @spec due(t(), integer(), leader :: atom() | nil) :: {[Event.t()], t()}
  def due(script, now_ms, leader) do
    {due, pending} =
      Enum.split_with(script.pending, fn {at_ms, event} ->
        at_ms <= now_ms and (leader != nil or Event.robot(event) != :leader)
      end)

    events = for {_at_ms, event} <- due, do: Event.name(event, leader)
    lasts_ms = for event <- events, do: now_ms + ms(Event.lasts_s(event))
    last_ms = Enum.max([script.last_ms | lasts_ms])
    {events, %{script | pending: pending, last_ms: last_ms}}
  end

  @doc "Whether no events are left, and the landmark stands still."
  @spec over?(t(), Sim.World.t()) :: boolean()
  def over?(script, world), do: script.pending == [] and world.goal == nil

  @doc "When the last event happened, or its effect ended."
  @spec last_ms(t()) :: integer()
  def last_ms(script), do: script.last_ms

  defp ms(seconds), do: round(seconds * 1000)
end
