defmodule Soak.Judge.Leaders do
  @moduledoc """
  Judges leaders: of two robots that reach each other, at most one leads; and never two in the same epoch. Pure;
  times in microseconds.

  What is allowed comes from docs/times.md: who has come to reach whom may not
  know it for 2 s, and a leader that should step down does so within the lease of 1.5 s. Parts that were cut off from each
  other count their epochs by themselves, so two epochs are compared only where both leaderships began
  among robots that knew each other.
  """
  alias Soak.Links

  @known_us 2_000_000
  @lease_us 1_500_000
  # Claims are read from boards each 100 ms, on a machine that is busy with other things.
  @slack_us 300_000

  defstruct leading: %{}, worst_us: 0

  @typedoc "`leading` is who leads: since when, in which epoch; `worst_us` for how long two did so that may not."
  @type t :: %__MODULE__{leading: %{atom() => {integer(), integer()}}, worst_us: integer()}

  @doc "A robot claims something else than before; `nil` when it is gone."
  @spec note(t(), atom(), map() | nil, integer()) :: t()
  def note(leaders, robot, %{phase: :lead, epoch: epoch}, us) do
    case leaders.leading do
      %{^robot => {_since, ^epoch}} -> leaders
      leading -> %{leaders | leading: Map.put(leading, robot, {us, epoch})}
    end
  end

  def note(leaders, robot, _another, _us),
    do: %{leaders | leading: Map.delete(leaders.leading, robot)}

  @doc "What is wrong now."
  @spec judge(t(), Links.t(), integer()) :: {[{String.t(), term()}], t()}
  def judge(leaders, links, now) do
    pairs =
      for {a, one} <- leaders.leading,
          {b, other} <- leaders.leading,
          a < b,
          met = Links.met(links, a, b) do
        {a, b, one, other, met + @known_us}
      end

    late =
      for {_a, _b, {from, _}, {since, _}, known} <- pairs,
          do: now - Enum.max([from, since, known])

    wrong = Enum.flat_map(pairs, &wrong(&1, now))
    {wrong, %{leaders | worst_us: Enum.max([leaders.worst_us | late])}}
  end

  defp wrong({a, b, {from, epoch}, {since, epoch}, known}, _now)
       when known < from and known < since,
       do: [{"#{a} and #{b} both lead in epoch #{epoch}", {:epoch, a, b, epoch}}]

  defp wrong({a, b, {from, one}, {since, other}, known}, now) do
    late_us = now - Enum.max([from, since, known])

    if late_us > @lease_us + @slack_us,
      do: [
        {"#{a} (epoch #{one}) and #{b} (epoch #{other}) have both led for #{div(late_us, 1000)} ms",
         {:two, a, b, from, since}}
      ],
      else: []
  end
end
