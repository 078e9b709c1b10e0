defmodule Swarm.EStop.State do
  @moduledoc """
  The spreading and clearing of an emergency stop, as a function. Pure.

  Stops are numbered. Every heartbeat carries the highest number that its robot knows, and whether
  its own latch is set; a robot latches when it hears of a set latch with a number that no person
  has cleared here. So a robot that a person has reset is not stopped again by a neighbour that
  nobody has reset yet, and a robot that joins a fleet whose stop was cleared long ago is not
  stopped by it.

  No stop is refused because of its number, but a number is taken only so far as it is at most
  100,000 above the known one: from one heartbeat to the next, nobody can bring it near its end,
  and a robot that is far behind has caught up after a few.

  `calls` remembers which calls to stop were heard (`Swarm.EStop.Calls`), so that a late repeat does not latch again
  what a person has reset.
  """
  alias Swarm.EStop.Calls

  # No fleet counts this far between two heartbeats; taking any number would leave no room for
  # later ones.
  @leap 100_000

  defstruct known: 0, cleared: 0, latched?: false, calls: []

  @type t :: %__MODULE__{
          known: non_neg_integer(),
          cleared: non_neg_integer(),
          latched?: boolean(),
          calls: Calls.t()
        }

  @doc """
  The state without a known stop; `latched?` if the robot's own latch has survived a restart.
  """
  @spec new(boolean()) :: t()
  def new(latched? \\ false), do: if(latched?, do: press(%__MODULE__{}), else: %__MODULE__{})

  @doc """
  Somebody stops the fleet here.

      iex> Swarm.EStop.State.press(Swarm.EStop.State.new()).latched?
      true
  """
  @spec press(t()) :: t()
  def press(%__MODULE__{known: known} = stop), do: %{stop | known: known + 1, latched?: true}

  @doc """
  Hears a call to stop; one that was heard before changes nothing. A robot that is already stopped
  does not give it a new number; otherwise its own and its neighbours' numbers could overtake each
  other while a person resets them.

      iex> call = {:base@hall, 1_700_000_000_000, 1}
      iex> stop = Swarm.EStop.State.call(Swarm.EStop.State.new(), call)
      iex> {stop.known, stop.latched?}
      {1, true}
      iex> stop |> Swarm.EStop.State.reset() |> Swarm.EStop.State.call(call) |> Map.fetch!(:latched?)
      false
  """
  @spec call(t(), Calls.call()) :: t()
  def call(%__MODULE__{} = stop, call) do
    case Calls.hear(stop.calls, call) do
      {false, _calls} -> stop
      {true, calls} when stop.latched? -> %{stop | calls: calls}
      {true, calls} -> press(%{stop | calls: calls})
    end
  end

  @doc """
  Remembers a call that was made before a person reset this robot, but is heard for the first time
  only now: it no longer stops anything.

      iex> call = {:base@hall, 1_700_000_000_000, 1}
      iex> stop = Swarm.EStop.State.late(Swarm.EStop.State.new(), call)
      iex> Swarm.EStop.State.call(stop, call).latched?
      false
  """
  @spec late(t(), Calls.call()) :: t()
  def late(%__MODULE__{} = stop, call), do: %{stop | calls: elem(Calls.hear(stop.calls, call), 1)}

  @doc """
  Follows the latch of the robot, which the buttons on its gate also set and clear: a stop pressed
  on the robot itself spreads like any other.

      iex> Swarm.EStop.State.follow(Swarm.EStop.State.new(), true).known
      1
  """
  @spec follow(t(), latched? :: boolean()) :: t()
  def follow(%__MODULE__{latched?: latched?} = stop, latched?), do: stop
  def follow(stop, true), do: press(stop)
  def follow(stop, false), do: reset(stop)

  @doc """
  Hears the number and the latch of a neighbour's heartbeat.

      iex> stop = Swarm.EStop.State.hear(Swarm.EStop.State.new(), 3, true)
      iex> stop.latched?
      true
      iex> Swarm.EStop.State.hear(Swarm.EStop.State.reset(stop), 3, true).latched?
      false
      iex> Swarm.EStop.State.hear(Swarm.EStop.State.new(), 3, false).latched?
      false
  """
  @spec hear(t(), non_neg_integer(), boolean()) :: t()
  def hear(%__MODULE__{} = stop, number, latched?) do
    number = min(number, stop.known + @leap)

    cond do
      latched? and number > stop.cleared ->
        %{stop | known: max(stop.known, number), latched?: true}

      # A stop was pressed here before this robot knew how far the fleet had counted. Others
      # consider that number cleared, so it gets a number that nobody has cleared.
      stop.latched? and number > stop.known ->
        %{stop | known: number + 1}

      true ->
        %{stop | known: max(stop.known, number)}
    end
  end

  @doc "A person clears this robot's latch."
  @spec reset(t()) :: t()
  def reset(%__MODULE__{known: known} = stop),
    do: %{stop | cleared: known, latched?: false}
end
