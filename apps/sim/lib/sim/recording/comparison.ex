defmodule Sim.Recording.Comparison do
  @moduledoc "Compares two recordings tick by tick, and finds where they part. Pure."
  alias Sim.Recording

  @typedoc """
  The first tick that differs: the first entry that only one of them has there, or that is
  different; `nil` where one has ended.
  """
  @type difference :: %{
          at_ms: non_neg_integer(),
          entries: {Sim.Trial.entry() | nil, Sim.Trial.entry() | nil}
        }

  @doc """
  The first difference of two runs' ticks, or how many ticks are equal.

      iex> tick = {100, [{:world, 0, {:kill, :mag1}}]}
      iex> Sim.Recording.Comparison.first([tick], [tick])
      {:same, 1}
      iex> Sim.Recording.Comparison.first([tick], [{100, []}])
      {:differs, %{at_ms: 100, entries: {{:world, 0, {:kill, :mag1}}, nil}}}
      iex> Sim.Recording.Comparison.first([tick, {200, []}], [tick])
      {:ends, 1}
  """
  @spec first(Enumerable.t(), Enumerable.t()) ::
          {:same, non_neg_integer()}
          | {:ends, after_ticks :: non_neg_integer()}
          | {:differs, difference()}
  def first(one, other) do
    one
    |> pairs(other)
    |> Enum.reduce_while({:same, 0}, fn
      {tick, tick}, {:same, count} -> {:cont, {:same, count + 1}}
      {nil, _tick}, {:same, count} -> {:halt, {:ends, count}}
      {_tick, nil}, {:same, count} -> {:halt, {:ends, count}}
      {tick, other}, _same -> {:halt, {:differs, difference(tick, other)}}
    end)
  end

  # Until both have ended; `nil` after the end of the shorter one.
  defp pairs(one, other) do
    [endless(one), endless(other)] |> Stream.zip() |> Stream.take_while(&(&1 != {nil, nil}))
  end

  defp endless(ticks), do: Stream.concat(ticks, Stream.cycle([nil]))

  @spec difference(Recording.tick(), Recording.tick()) :: difference()
  defp difference({at_ms, entries}, {other_ms, others}),
    do: %{at_ms: min(at_ms, other_ms), entries: part(entries, others)}

  defp part([entry | entries], [entry | others]), do: part(entries, others)
  defp part(entries, others), do: {List.first(entries), List.first(others)}
end
