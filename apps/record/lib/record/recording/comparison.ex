defmodule Record.Recording.Comparison do
  @moduledoc "Compares two recordings of a kind tick by tick, and finds where they part. Pure."
  @typedoc "A tick: its entries in their order, and the time at its end."
  @type tick :: {at_ms :: non_neg_integer(), entries :: [term()]}

  @typedoc """
  The first tick that differs: the first entry that only one of them has there, or that is
  different; `nil` where one has ended.
  """
  @type difference :: %{
          at_ms: non_neg_integer(),
          entries: {entry :: term() | nil, entry :: term() | nil}
        }

  @doc """
  The first difference of the ticks of two recordings, or when the last equal tick ended.

      iex> tick = {100, [{:world, 0, {:kill, :mag1}}]}
      iex> Record.Recording.Comparison.first([tick], [tick])
      {:same, 100}
      iex> Record.Recording.Comparison.first([tick], [{100, []}])
      {:differs, %{at_ms: 100, entries: {{:world, 0, {:kill, :mag1}}, nil}}}
      iex> Record.Recording.Comparison.first([tick, {200, []}], [tick])
      {:ends, 100}
  """
  @spec first(Enumerable.t(), Enumerable.t()) ::
          {:same, until_ms :: non_neg_integer()}
          | {:ends, after_ms :: non_neg_integer()}
          | {:differs, difference()}
  def first(one, other) do
    one
    |> pairs(other)
    |> Enum.reduce_while({:same, 0}, fn
      {{at_ms, _entries} = tick, tick}, _same -> {:cont, {:same, at_ms}}
      {nil, _tick}, {:same, at_ms} -> {:halt, {:ends, at_ms}}
      {_tick, nil}, {:same, at_ms} -> {:halt, {:ends, at_ms}}
      {tick, other}, _same -> {:halt, {:differs, difference(tick, other)}}
    end)
  end

  # Until both have ended; `nil` after the end of the shorter one.
  defp pairs(one, other) do
    [endless(one), endless(other)] |> Stream.zip() |> Stream.take_while(&(&1 != {nil, nil}))
  end

  defp endless(ticks), do: Stream.concat(ticks, Stream.cycle([nil]))

  # In a gap of one recording the other one has more.
  @spec difference(tick(), tick()) :: difference()
  defp difference({at_ms, entries}, {at_ms, others}),
    do: %{at_ms: at_ms, entries: part(entries, others)}

  defp difference({at_ms, entries}, {other_ms, _others}) when at_ms < other_ms,
    do: %{at_ms: at_ms, entries: part(entries, [])}

  defp difference(_later, {at_ms, others}), do: %{at_ms: at_ms, entries: part([], others)}

  defp part([entry | entries], [entry | others]), do: part(entries, others)
  defp part(entries, others), do: {List.first(entries), List.first(others)}
end
