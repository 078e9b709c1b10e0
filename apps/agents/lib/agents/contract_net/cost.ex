defmodule Agents.ContractNet.Cost do
  @moduledoc "Estimates the cost of a task for a robot, so that bids can be compared. Pure."

  @type t :: number() | :infinite

  @doc """
  `time * path / speed + energy * joules + other * rest`, with the weights `:time`, `:energy` and
  `:other` (default 1, 0, 0). Keys: `:path` (metres, or `:none` if there is no way), `:speed` (m/s),
  `:energy` (joules) and `:other`, default 0. What cannot be done costs `:infinite`.

      iex> Agents.ContractNet.Cost.of([path: 3.0, speed: 0.3, energy: 50], time: 1, energy: 0.1)
      15.0
      iex> Agents.ContractNet.Cost.of(path: :none, speed: 0.3)
      :infinite
      iex> Agents.ContractNet.Cost.of(path: 3.0, speed: 0)
      :infinite
  """
  @spec of(keyword(), keyword()) :: t()
  def of(parts, weights \\ []) do
    parts = Keyword.validate!(parts, [:path, :speed, energy: 0, other: 0])
    weights = Keyword.validate!(weights, time: 1, energy: 0, other: 0)

    with seconds when is_number(seconds) <- seconds(parts[:path], parts[:speed]),
         energy when is_number(energy) <- parts[:energy],
         other when is_number(other) <- parts[:other] do
      weights[:time] * seconds + weights[:energy] * energy + weights[:other] * other
    else
      _infeasible -> :infinite
    end
  end

  defp seconds(path, speed) when is_number(path) and is_number(speed) and speed > 0,
    do: path / speed

  # A task without a path needs no speed.
  defp seconds(path, _speed) when path == 0, do: 0
  defp seconds(_path, _speed), do: :infinite
end
