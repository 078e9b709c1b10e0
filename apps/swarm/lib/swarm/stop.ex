defmodule Swarm.Stop do
  @moduledoc """
  How an emergency stop spreads and is cleared, as a function. Pure.

  Stops are numbered. Every heartbeat tells the highest number that its robot knows, and whether
  its own latch is set; a robot latches when it hears of a set latch with a number that no person
  has cleared here. So one that a person has reset is not caught again by a neighbour that nobody
  has reset yet, and one that joins a fleet whose stop is long cleared is not stopped by it.
  """

  @leap 100_000

  defstruct known: 0, cleared: 0, latched?: false

  @type t :: %__MODULE__{
          known: non_neg_integer(),
          cleared: non_neg_integer(),
          latched?: boolean()
        }

  @doc "No stop known; `latched?` when the robot's own latch has survived a restart."
  @spec new(boolean()) :: t()
  def new(latched? \\ false), do: if(latched?, do: press(%__MODULE__{}), else: %__MODULE__{})

  @doc """
  Somebody stops the fleet here.

      iex> Swarm.Stop.press(Swarm.Stop.new()).latched?
      true
  """
  @spec press(t()) :: t()
  def press(%__MODULE__{known: known} = stop), do: %{stop | known: known + 1, latched?: true}

  @doc """
  Hears what a neighbour's heartbeat says: its number, and whether its latch is set.

      iex> stop = Swarm.Stop.hear(Swarm.Stop.new(), 3, true)
      iex> stop.latched?
      true
      iex> Swarm.Stop.hear(Swarm.Stop.reset(stop), 3, true).latched?
      false
      iex> Swarm.Stop.hear(Swarm.Stop.new(), 3, false).latched?
      false
  """
  @spec hear(t(), non_neg_integer(), boolean()) :: t()
  def hear(%__MODULE__{} = stop, number, latched?) do
    cond do
      # No fleet counts that far at once; taken over, it would leave no room for numbers to come.
      number > stop.known + @leap ->
        stop

      latched? and number > stop.cleared ->
        %{stop | known: max(stop.known, number), latched?: true}

      # A stop pressed here before this robot knew how far the fleet had counted: others take
      # it for one that is cleared, so it gets a number that nobody has cleared.
      stop.latched? and number > stop.known ->
        %{stop | known: number + 1}

      true ->
        %{stop | known: max(stop.known, number)}
    end
  end

  @doc "A person clears this robot's latch."
  @spec reset(t()) :: t()
  def reset(%__MODULE__{known: known}), do: %__MODULE__{known: known, cleared: known}
end
