defmodule Swarm.EStop.Calls do
  @moduledoc false
  # Remembers which calls to stop were heard (`Swarm.EStop.Broadcaster`). A call is sent many times
  # and arrives by several ways; it counts once. Pure.
  #
  # Of each life of a node the last call is remembered, with the 64 counters up to its own: a call
  # that was overtaken by a later one does not stop anything again. A call that is farther from it
  # is remembered beside it, so that a wrong counter, however high, hides no later call: at worst a
  # robot stops once more. At most 64 are remembered in all.
  alias Swarm.Wire

  @most 64
  @window 64
  @near 32
  # Boot numbers are times in ms, or, on finer clocks, in ns.
  @latest 0xFFFFFFFFFFFFFFFF

  @typedoc """
  The identity of a call: the node that calls, that node's life, and a counter that grows with its
  calls.
  """
  @type call :: {node(), boot :: integer(), counter :: integer()}

  @type t :: [{node(), {boot :: integer(), counter :: integer()}}]

  @doc """
  Hears a call, and returns whether it is a new one.

      iex> {true, calls} = Swarm.EStop.Calls.hear([], {:base@hall, 1_700_000_000_000, 2})
      iex> Swarm.EStop.Calls.hear(calls, {:base@hall, 1_700_000_000_000, 1})
      {false, [{:base@hall, {1_700_000_000_000, 2}}]}
  """
  @spec hear(t(), call()) :: {new? :: boolean(), t()}
  def hear(calls, {node, boot, counter}) do
    # Separately for each life of a node: otherwise repeated calls of two lives would each seem
    # new after the other, and robots would pass them on to each other for ever. For the same
    # reason a call takes the place only of those that it still covers.
    ahead = for {^node, {^boot, last}} <- calls, do: last - counter

    if Enum.any?(ahead, &(&1 in 0..(@window - 1))) do
      {false, calls}
    else
      others =
        Enum.reject(calls, &match?({^node, {^boot, last}} when (counter - last) in 0..@near, &1))

      {true, Enum.take([{node, {boot, counter}} | others], @most)}
    end
  end

  @doc """
  Whether a term from outside is a call to stop.

      iex> for term <- [{:base@hall, 1, 1}, {nil, 1, 1}, {:base@hall, 1}], do: Swarm.EStop.Calls.call?(term)
      [true, false, false]
  """
  @spec call?(term()) :: boolean()
  def call?({node, boot, counter}),
    do: Wire.name?(node) and number?(boot) and number?(counter)

  def call?(_other), do: false

  @doc "Whether a term from outside can be the age of a call, in ms: at most a day."
  @spec age?(term()) :: boolean()
  def age?(term), do: is_integer(term) and term in 0..86_400_000

  @doc "Whether a term from outside is a list of calls that were heard."
  @spec heard?(term()) :: boolean()
  def heard?(term), do: Wire.list?(term, &match?({_node, {_boot, _counter}}, &1))

  defp number?(number), do: is_integer(number) and number in 0..@latest
end
