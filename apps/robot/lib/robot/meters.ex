defmodule Robot.Meters do
  @moduledoc """
  Counts what happens to a robot since its board began: the way of its wheels, stops by their reason, starts of its processes,
  how late its decisions come. Any process of its node counts; nothing is decided by it.
  """
  # Upper bounds of the classes of lateness, ms.
  @late_ms [1, 2, 5, 10, 20, 50, 100, 200, 500]

  @type t :: :ets.tid()

  @typedoc """
  What was counted: metres driven, stops by the limit that made the gate stop, how often each role was started again, and of the
  ticks that a role was woken for, how many came at most so late (`late_s`: `{bound, count}`, each with those before it), their number and the sum
  of their lateness in seconds.
  """
  @type counts :: %{
          distance_m: float(),
          stops: %{atom() => pos_integer()},
          restarts: %{atom() => non_neg_integer()},
          late_s: [{float(), non_neg_integer()}],
          ticks: non_neg_integer(),
          late_sum_s: float()
        }

  @doc "Nothing is counted yet; the table is the caller's."
  @spec new() :: t()
  def new, do: :ets.new(__MODULE__, [:public, write_concurrency: true])

  @doc "A role begins, for the first time or again."
  @spec began(t(), role :: atom()) :: :ok
  def began(meters, role), do: count(meters, {:began, role}, 1)

  @doc "The gate stops the wheels for another reason than before."
  @spec stopped(t(), limit :: atom()) :: :ok
  def stopped(meters, limit), do: count(meters, {:stopped, limit}, 1)

  @doc "The wheels have driven so far, in metres."
  @spec drove(t(), number()) :: :ok
  def drove(meters, metres), do: count(meters, :drove_um, round(metres * 1.0e6))

  @doc "A tick came so much later than it was due, in ms."
  @spec late(t(), integer()) :: :ok
  def late(meters, late_ms) do
    late_ms = max(late_ms, 0)
    count(meters, {:late, Enum.find(@late_ms, :more, &(late_ms <= &1))}, 1)
    count(meters, :late_ms, late_ms)
  end

  # A board that has ended has no meters.
  defp count(meters, key, by) do
    _count = :ets.update_counter(meters, key, by, {key, 0})
    :ok
  rescue
    ArgumentError -> :ok
  end

  @doc """
  What was counted so far.

      iex> alias Robot.Meters
      iex> meters = Meters.new()
      iex> for {late, metres} <- [{0, 0.5}, {7, 0.25}, {900, 0}], do: {Meters.late(meters, late), Meters.drove(meters, metres)}
      iex> for role <- [:gate, :gate, :pilot], do: Meters.began(meters, role)
      iex> counts = Meters.read(meters)
      iex> {counts.distance_m, counts.restarts, counts.ticks, counts.late_sum_s}
      {0.75, %{gate: 1, pilot: 0}, 3, 0.907}
      iex> Enum.take(counts.late_s, 4)
      [{0.001, 1}, {0.002, 1}, {0.005, 1}, {0.01, 2}]
  """
  @spec read(t()) :: counts()
  def read(meters) do
    counted = Map.new(:ets.tab2list(meters))

    {late_s, below} =
      Enum.map_reduce(@late_ms, 0, fn bound, below ->
        below = below + Map.get(counted, {:late, bound}, 0)
        {{bound / 1_000, below}, below}
      end)

    %{
      distance_m: Map.get(counted, :drove_um, 0) / 1.0e6,
      stops: for({{:stopped, limit}, count} <- counted, into: %{}, do: {limit, count}),
      restarts: for({{:began, role}, count} <- counted, into: %{}, do: {role, count - 1}),
      late_s: late_s,
      ticks: below + Map.get(counted, {:late, :more}, 0),
      late_sum_s: Map.get(counted, :late_ms, 0) / 1_000
    }
  end
end
