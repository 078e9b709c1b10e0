defmodule Robot.Localiser.Covariance do
  @moduledoc false
  # Defines a covariance matrix as a list of its rows, and the operations of an extended Kalman filter on
  # it. Pure.
  #
  # A belief has at most 20 states, for which lists are fast enough.

  @type t :: [[float()]]

  @doc """
  A matrix with these standard deviations and no correlation.

      iex> Robot.Localiser.Covariance.diagonal([0.5, 2.0])
      [[0.25, 0.0], [0.0, 4.0]]
  """
  @spec diagonal([float()]) :: t()
  def diagonal(sds) do
    for {sd, i} <- Enum.with_index(sds),
        do: for({_sd, j} <- Enum.with_index(sds), do: if(i == j, do: sd * sd, else: 0.0))
  end

  @doc """
  F P F', where `rows` computes F A from the rows of any matrix A.

      iex> Robot.Localiser.Covariance.carry([[1.0, 0.0], [0.0, 4.0]], fn [a, b] -> [b, a] end)
      [[4.0, 0.0], [0.0, 1.0]]
  """
  @spec carry(t(), (t() -> t())) :: t()
  def carry(p, rows), do: p |> rows.() |> transpose() |> rows.()

  # One pass for each column: this is the most frequent work of a filter.
  defp transpose([[] | _rows]), do: []

  defp transpose(rows) do
    {column, rest} = split(rows)
    [column | transpose(rest)]
  end

  defp split([]), do: {[], []}

  defp split([[x | xs] | rows]) do
    {column, rest} = split(rows)
    {[x | column], [xs | rest]}
  end

  @doc """
  The matrix with these variances added to its first states.

      iex> Robot.Localiser.Covariance.add([[1.0, 0.5], [0.5, 1.0]], [2.0])
      [[3.0, 0.5], [0.5, 1.0]]
  """
  @spec add(t(), [float()]) :: t()
  def add(p, variances), do: add(p, variances, 0)

  @doc "The matrix with these variances added to its states from `index` on."
  @spec add(t(), [float()], index :: non_neg_integer()) :: t()
  def add(p, variances, index) do
    variances
    |> Enum.with_index(index)
    |> Enum.reduce(p, fn {variance, i}, p ->
      List.update_at(p, i, fn row -> List.update_at(row, i, &(&1 + variance)) end)
    end)
  end

  @doc """
  The matrix with new states of this covariance after the others. Each new state depends on the
  state `index` by its share of `shares`, and is correlated with the others only through it.

      iex> Robot.Localiser.Covariance.append([[1.0]], [[0.25]], 0, [0.0])
      [[1.0, 0.0], [0.0, 0.25]]
      iex> Robot.Localiser.Covariance.append([[4.0, 1.0], [1.0, 1.0]], [[0.25]], 1, [0.5])
      [[4.0, 1.0, 0.5], [1.0, 1.0, 0.5], [0.5, 0.5, 0.25]]
  """
  @spec append(t(), new :: t(), index :: non_neg_integer(), shares :: [float()]) :: t()
  def append(p, new, index, shares) do
    with_it = Enum.at(p, index)
    above = for {row, x} <- Enum.zip(p, with_it), do: row ++ Enum.map(shares, &(&1 * x))
    below = for {row, k} <- Enum.zip(new, shares), do: Enum.map(with_it, &(k * &1)) ++ row
    above ++ below
  end

  @doc """
  The matrix with one state replaced: with this standard deviation and no correlation.

      iex> Robot.Localiser.Covariance.replace([[1.0, 0.5], [0.5, 1.0]], 1, 2.0)
      [[1.0, 0.0], [0.0, 4.0]]
  """
  @spec replace(t(), index :: non_neg_integer(), sd :: float()) :: t()
  def replace(p, index, sd) do
    for {row, i} <- Enum.with_index(p) do
      for {x, j} <- Enum.with_index(row) do
        cond do
          i == index and j == index -> sd * sd
          i == index or j == index -> 0.0
          true -> x
        end
      end
    end
  end

  @doc """
  The matrix without the `count` states from `index` on.

      iex> Robot.Localiser.Covariance.drop([[1.0, 2.0, 3.0], [2.0, 5.0, 6.0], [3.0, 6.0, 9.0]], 1, 2)
      [[1.0]]
  """
  @spec drop(t(), index :: non_neg_integer(), count :: pos_integer()) :: t()
  def drop(p, index, count) do
    cut = fn list -> Enum.take(list, index) ++ Enum.drop(list, index + count) end
    p |> cut.() |> Enum.map(cut)
  end

  @doc """
  P H' and H P H' for a measurement whose expected value has the derivatives `slope` (H) by the
  states; if H is shorter than the state, its other derivatives are zero.

      iex> Robot.Localiser.Covariance.project([[2.0, 1.0], [1.0, 3.0]], [1.0])
      {[2.0, 1.0], 2.0}
  """
  @spec project(t(), slope :: [float()]) :: {[float()], float()}
  def project(p, slope) do
    v = Enum.map(p, &dot(&1, slope))
    {v, dot(v, slope)}
  end

  @doc """
  H P H' alone, for `slope` H as in `project/2`: only the rows are computed for which H has a
  derivative.

      iex> Robot.Localiser.Covariance.variance([[2.0, 1.0], [1.0, 3.0]], [1.0])
      2.0
  """
  @spec variance(t(), slope :: [float()]) :: float()
  # That of a pose, which is asked for most, in the order of `dot/2`.
  def variance([[xx, xy, xh | _], [yx, yy, yh | _], [hx, hy, hh | _] | _], [a, b, c]) do
    x = xx * a + (xy * b + (xh * c + 0.0))
    y = yx * a + (yy * b + (yh * c + 0.0))
    h = hx * a + (hy * b + (hh * c + 0.0))
    x * a + (y * b + (h * c + 0.0))
  end

  def variance(p, slope), do: dot(rows(p, slope, slope), slope)

  defp rows([row | rows], slope, [_x | xs]), do: [dot(row, slope) | rows(rows, slope, xs)]
  defp rows(_rows, _slope, []), do: []

  @doc """
  The element of P H' for one state, for `slope` H as in `project/2`.

      iex> Robot.Localiser.Covariance.project_state([[2.0, 1.0], [1.0, 3.0]], 1, [1.0])
      1.0
  """
  @spec project_state(t(), index :: non_neg_integer(), slope :: [float()]) :: float()
  # That of the common error with a pose, which is asked for most.
  def project_state([_, _, _, _, _, _, _, [x, y, h | _] | _], 7, [a, b, c]),
    do: x * a + (y * b + (h * c + 0.0))

  def project_state(p, index, slope), do: index |> Kernel.+(1) |> :lists.nth(p) |> dot(slope)

  @doc "P - v v' / s: the covariance after a measurement (`project/2`) of innovation variance s."
  @spec reduce(t(), [float()], float()) :: t()
  def reduce(p, v, s), do: for({row, x} <- Enum.zip(p, v), do: less(row, v, x / s))

  defp dot([x | xs], [y | ys]), do: x * y + dot(xs, ys)
  defp dot(_xs, _ys), do: 0.0

  defp less([], [], _k), do: []
  defp less([x | xs], [v | vs], k), do: [x - k * v | less(xs, vs, k)]
end
