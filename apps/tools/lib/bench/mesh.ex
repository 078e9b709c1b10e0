defmodule Bench.Mesh do
  @moduledoc """
  Lists what `mix bench swarm` measures, and what it should beat: the cases with their goals, and JADE's
  figures, which were measured separately. Pure. Times are microseconds, memory is bytes, shares are percent.
  """
  alias Hal.Cli.Parse

  @type size :: pos_integer() | :one
  @typedoc "`:one` is many robots in one node."
  @type case :: %{
          name: atom(),
          says: String.t(),
          unit: :time | :memory | :rate | :share,
          bare: atom() | nil
        }

  @ms 1_000
  @s 1_000_000
  @mb 1_048_576

  @doc "All cases. `bare` is the case of bare OTP to compare with, or `nil` if there is none."
  @spec cases() :: [case()]
  def cases do
    [
      at(:start, "start of all to a full mesh", :time, :start),
      at(:memory, "memory of a node, resident", :memory, :memory),
      at(:cpu, "processor time of an idle robot's node, of one core", :share, :cpu),
      at(:ping, "command to all + all replies", :time, :ping),
      at(:gather, "envelope to all + all replies", :time, :ping),
      at(:round, "everyone to everyone", :time, :round),
      at(:join, "a robot that joins is visible", :time, :join),
      at(:kill, "noticing kill -9", :time, :kill),
      at(:cold, "cold start of a robot to visible", :time, :cold),
      at(
        :freeze,
        "noticing a freeze (SIGSTOP; bare OTP with net_ticktime 4, else a minute and more)",
        :time,
        :freeze
      ),
      at(:silence, "noticing silence of the datagrams", :time, nil),
      at(:rate, "ticks a second: slowest robot / median", :rate, nil)
    ]
  end

  @doc """
  Cases by name, in the order of the table.

      iex> {:ok, cases} = Bench.Mesh.choose("round,ping")
      iex> Enum.map(cases, & &1.name)
      [:ping, :round]
      iex> Bench.Mesh.choose("pong") |> elem(0)
      :error
  """
  @spec choose(String.t()) :: {:ok, [case()]} | {:error, String.t()}
  def choose(text), do: Parse.named(text, cases())

  @doc """
  The goal as `{p50, p99}`, `nil` where there is none.

      iex> Bench.Mesh.goal(:ping, 3)
      {150, 1_000}
      iex> Bench.Mesh.goal(:round, 17)
      {nil, nil}
  """
  @spec goal(atom(), size()) :: {number() | nil, number() | nil}
  def goal(case, size)
  def goal(name, 3) when name in [:ping, :gather], do: {150, 1 * @ms}
  def goal(name, 10) when name in [:ping, :gather], do: {400, nil}
  def goal(name, 30) when name in [:ping, :gather], do: {1_200, nil}
  def goal(name, :one) when name in [:ping, :gather], do: {300, 1 * @ms}
  def goal(:round, 3), do: {300, nil}
  def goal(:round, 10), do: {5 * @ms, nil}
  def goal(:round, 30), do: {40 * @ms, nil}
  def goal(:round, :one), do: {12 * @ms, nil}
  def goal(:join, _size), do: {300, 1 * @ms}
  def goal(:kill, _size), do: {20 * @ms, nil}
  def goal(name, _size) when name in [:freeze, :silence], do: {2 * @s, nil}
  def goal(:memory, size) when size != :one, do: {60 * @mb, nil}
  def goal(:cpu, 3), do: {0.8, nil}
  def goal(:cpu, 30), do: {1.5, nil}
  def goal(:cold, _size), do: {1 * @s, nil}
  def goal(:start, 3), do: {1_500 * @ms, nil}
  def goal(:start, 10), do: {3 * @s, nil}
  def goal(:start, 30), do: {8 * @s, nil}
  def goal(:rate, _size), do: {10, nil}
  def goal(_case, _size), do: {nil, nil}

  @doc "The time that JADE 4.3 took on such a machine on another day; `nil` if not measured."
  @spec jade(atom(), size()) :: String.t() | nil
  def jade(name, 3) when name in [:ping, :gather], do: "755 us / 8.2 ms"
  def jade(name, :one) when name in [:ping, :gather], do: "2.1 / 11 ms"
  def jade(:round, 3), do: "1.2 ms"
  def jade(:round, :one), do: "440 ms"
  def jade(:join, 3), do: "2.1 / 13 ms"
  def jade(:kill, 3), do: "11 ms"
  def jade(:freeze, 3), do: "not in 200 s"
  def jade(:silence, 3), do: "12 s"
  def jade(:memory, 3), do: "55 MB"
  def jade(:cold, 3), do: "210 ms"
  def jade(:start, 3), do: "0.58 s"
  def jade(_case, _size), do: nil

  @doc "How often a case is repeated: `{batches, times per batch}`; `share` reduces both."
  @spec times(atom(), size(), share :: float()) :: {pos_integer(), pos_integer()}
  def times(case, size, share) do
    {batches, times} = times(case, size)
    {batches, max(round(times * share), 2)}
  end

  defp times(:round, size) when size in 1..9, do: {10, 300}
  defp times(:round, size) when size in 10..19, do: {10, 100}
  defp times(:round, _many), do: {10, 20}
  defp times(:join, _size), do: {10, 50}
  defp times(name, size) when name in [:ping, :gather] and size in 1..19, do: {10, 500}
  defp times(name, _many) when name in [:ping, :gather], do: {10, 200}
  defp times(_slow, _size), do: {1, 5}

  defp at(name, says, unit, bare), do: %{name: name, says: says, unit: unit, bare: bare}
end
