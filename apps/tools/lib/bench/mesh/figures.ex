defmodule Bench.Mesh.Figures do
  @moduledoc false
  # Reduces many measurements to two figures. Pure. The first is the median of the batches' medians,
  # so that a disturbance of one batch does not count; the second covers all measurements, so that
  # nothing is hidden.
  alias Bench.Table

  # With fewer values the 99th percentile is simply the largest.
  @enough 100

  @type t :: %{p50: number(), p99: number(), max: number(), count: pos_integer()}

  @doc """
  The figures of some batches. With fewer than a hundred values, `p99` is the largest.

      iex> Bench.Mesh.Figures.of([[1, 2, 3], [2, 3, 4], [7, 8, 9]])
      %{count: 9, max: 9, p50: 3, p99: 9}
      iex> Bench.Mesh.Figures.of([[], []])
      nil
  """
  @spec of([[number()]]) :: t() | nil
  def of(batches) do
    case Enum.concat(batches) do
      [] ->
        nil

      all ->
        medians = for [_ | _] = batch <- batches, do: Table.quantile(batch, 0.5)
        largest = Enum.max(all)
        p99 = if length(all) < @enough, do: largest, else: Table.quantile(all, 0.99)
        %{p50: Table.quantile(medians, 0.5), p99: p99, max: largest, count: length(all)}
    end
  end

  @doc """
  How many times as long our system takes.

      iex> Bench.Mesh.Figures.ratio(300, 200)
      1.5
      iex> Bench.Mesh.Figures.ratio(300, nil)
      nil
  """
  @spec ratio(number() | nil, number() | nil) :: float() | nil
  def ratio(ours, bare) when is_number(ours) and is_number(bare) and bare > 0, do: ours / bare
  def ratio(_ours, _bare), do: nil
end
