defmodule Swarm.EStop.State do
  @moduledoc """
  The spreading and clearing of an emergency stop, as a function. Pure.

  Stops are numbered. Every heartbeat carries the highest number that its robot knows, and whether
  its own latch is set; a robot latches when it hears of a set latch with a number that no person
  has cleared here. So a robot that a person has reset is not stopped again by a neighbour that
  nobody has reset yet, and a robot that joins a fleet whose stop was cleared long ago is not
  stopped by it.

  A number is a count with a tag of who stopped the fleet (`number/2`), because two parts of a
  fleet, or a robot that has just started, count without each other: stops of the same count are
  not the same stop. Where a stop meets a higher number of another one, which somebody may have
  cleared already, it gets a number that nobody has cleared.

  No stop is refused because of its number, but a number is taken only so far as it is at most
  100,000 counts above the known one: from one heartbeat to the next, nobody can bring it near its
  end, and a robot that is far behind has caught up after a few.

  `calls` remembers which calls to stop were heard (`Swarm.EStop.Calls`), so that a late repeat does not latch again
  what a person has reset.
  """
  import Bitwise
  alias Swarm.EStop.Calls

  @tag_bits 16
  @tags 1 <<< @tag_bits
  # No fleet counts this far between two heartbeats; taking any number would leave no room for
  # later ones.
  @leap 100_000 <<< @tag_bits

  defstruct known: 0, cleared: 0, latched?: false, own?: false, calls: []

  @typedoc """
  `own?` says that the stop was made here, by a press or a call, and has not met a higher number
  of another stop yet.
  """
  @type t :: %__MODULE__{
          known: non_neg_integer(),
          cleared: non_neg_integer(),
          latched?: boolean(),
          own?: boolean(),
          calls: Calls.t()
        }

  @doc """
  The state without a known stop; `latched?` if the robot's own latch has survived a restart.
  """
  @spec new(boolean()) :: t()
  def new(latched? \\ false)
  def new(false), do: %__MODULE__{}
  def new(true), do: %__MODULE__{known: 1 <<< @tag_bits, latched?: true}

  @doc """
  The number of a stop: its count, and the tag of the call that made it.

      iex> one = Swarm.EStop.State.number(3, {:base@hall, 1_700_000_000_000, 1})
      iex> {Bitwise.bsr(one, 16), one == Swarm.EStop.State.number(3, {:base@hall, 1_700_000_000_000, 2})}
      {3, false}
  """
  @spec number(count :: non_neg_integer(), Calls.call()) :: non_neg_integer()
  def number(count, call), do: (count <<< @tag_bits) + :erlang.phash2(call, @tags)

  @doc """
  Somebody stops the fleet here; the call, which is sent to the others, is remembered.

      iex> call = {:base@hall, 1_700_000_000_000, 1}
      iex> stop = Swarm.EStop.State.press(Swarm.EStop.State.new(), call)
      iex> {stop.latched?, stop.known == Swarm.EStop.State.number(1, call)}
      {true, true}
  """
  @spec press(t(), Calls.call()) :: t()
  def press(%__MODULE__{known: known} = stop, call) do
    stop = late(stop, call)
    %{stop | known: number(count(known) + 1, call), latched?: true, own?: true}
  end

  @doc """
  Hears a call to stop; one that was heard before changes nothing. A robot that is already stopped
  does not give it a new number; otherwise its own and its neighbours' numbers could overtake each
  other while a person resets them.

      iex> call = {:base@hall, 1_700_000_000_000, 1}
      iex> stop = Swarm.EStop.State.call(Swarm.EStop.State.new(), call)
      iex> {stop.known == Swarm.EStop.State.number(1, call), stop.latched?}
      {true, true}
      iex> stop |> Swarm.EStop.State.reset() |> Swarm.EStop.State.call(call) |> Map.fetch!(:latched?)
      false
  """
  @spec call(t(), Calls.call()) :: t()
  def call(%__MODULE__{} = stop, call) do
    case Calls.hear(stop.calls, call) do
      {false, _calls} -> stop
      {true, calls} when stop.latched? -> %{stop | calls: calls}
      {true, _calls} -> press(stop, call)
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
  on the robot itself spreads like any other, by this call.

      iex> call = {:base@hall, 1_700_000_000_000, 1}
      iex> stop = Swarm.EStop.State.follow(Swarm.EStop.State.new(), true, call)
      iex> stop == Swarm.EStop.State.press(Swarm.EStop.State.new(), call)
      true
  """
  @spec follow(t(), latched? :: boolean(), Calls.call()) :: t()
  def follow(%__MODULE__{latched?: latched?} = stop, latched?, _call), do: stop
  def follow(stop, true, call), do: press(stop, call)
  def follow(stop, false, _call), do: reset(stop)

  @doc """
  Hears the number and the latch of a neighbour's heartbeat.

      iex> three = Swarm.EStop.State.number(3, {:base@hall, 1_700_000_000_000, 1})
      iex> stop = Swarm.EStop.State.hear(Swarm.EStop.State.new(), three, true)
      iex> stop.latched?
      true
      iex> Swarm.EStop.State.hear(Swarm.EStop.State.reset(stop), three, true).latched?
      false
      iex> Swarm.EStop.State.hear(Swarm.EStop.State.new(), three, false).latched?
      false
  """
  @spec hear(t(), non_neg_integer(), boolean()) :: t()
  def hear(%__MODULE__{} = stop, number, latched?) do
    number = min(number, stop.known + @leap)

    cond do
      # Who knows the other stop may have cleared it, and would not hear of this one. Among robots that are stopped,
      # once: otherwise two stops could overtake each other for ever.
      stop.latched? and number > stop.known and (stop.own? or not latched?) and
          tag(number) != tag(stop.known) ->
        %{stop | known: after_number(number, stop.known), own?: false}

      # Counted by robots that do not know how far the fleet has counted.
      latched? and not stop.latched? and number > stop.cleared and number < stop.known ->
        %{stop | known: after_number(stop.known, number), latched?: true, own?: false}

      latched? and not stop.latched? and number > stop.cleared ->
        %{stop | known: number, latched?: true, own?: false}

      true ->
        %{stop | known: max(stop.known, number)}
    end
  end

  # The stop's number, when the others have counted so far.
  defp after_number(number, stop), do: ((count(number) + 1) <<< @tag_bits) + tag(stop)

  defp count(number), do: number >>> @tag_bits
  defp tag(number), do: number &&& @tags - 1

  @doc "A person clears this robot's latch."
  @spec reset(t()) :: t()
  def reset(%__MODULE__{known: known} = stop),
    do: %{stop | cleared: known, latched?: false, own?: false}
end
