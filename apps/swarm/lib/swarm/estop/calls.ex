defmodule Swarm.EStop.Calls do
  @moduledoc """
  Remembers which calls to stop were heard (`Swarm.EStop.Broadcaster`). A call is sent many times
  and arrives by several ways; it counts once. Pure.

  For each life of a node the last call is remembered, for at most 64 lives.
  """
  alias Swarm.Message.WireTypes

  @callers 64
  # Boot numbers are times in ms, or, on finer clocks, in ns.
  @latest 0xFFFFFFFFFFFFFFFF

  @typedoc "The identity of a call: the node that calls, that node's life, and a counter of its calls."
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
    # new after the other, and robots would pass them on to each other for ever.
    case Enum.split_with(calls, &match?({^node, {^boot, _last}}, &1)) do
      {[{_node, {_boot, last}} | _], _others} when counter <= last -> {false, calls}
      {_before, others} -> {true, Enum.take([{node, {boot, counter}} | others], @callers)}
    end
  end

  @doc """
  Whether a term from outside is a call to stop.

      iex> for term <- [{:base@hall, 1, 1}, {nil, 1, 1}, {:base@hall, 1}], do: Swarm.EStop.Calls.call?(term)
      [true, false, false]
  """
  @spec call?(term()) :: boolean()
  def call?({node, boot, counter}),
    do: WireTypes.name?(node) and number?(boot) and number?(counter)

  def call?(_other), do: false

  @doc "Whether a term from outside can be the age of a call, in ms: at most a day."
  @spec age?(term()) :: boolean()
  def age?(term), do: is_integer(term) and term in 0..86_400_000

  @doc "Whether a term from outside is a list of calls that were heard."
  @spec heard?(term()) :: boolean()
  def heard?(term), do: WireTypes.list?(term, &match?({_node, {_boot, _counter}}, &1))

  defp number?(number), do: is_integer(number) and number in 0..@latest
end
