defmodule Lab.Scenario.Names do
  @moduledoc false
  # Lists the names that robots of a scenario may have: `mag1` to `mag100` and `min1` to `min100`. Pure. The module holds
  # them all, so a file that names one makes no atom.

  @most 100
  @magellans for n <- 1..@most, do: :"mag#{n}"
  @minis for n <- 1..@most, do: :"min#{n}"

  @doc "All names."
  @spec all() :: [atom()]
  def all, do: @magellans ++ @minis

  @doc """
  A fleet of `count` robots, half of each kind, one more Magellan when the count is odd.

      iex> Lab.Scenario.Names.fleet(3)
      [:mag1, :mag2, :min1]
  """
  @spec fleet(1..100) :: [atom()]
  def fleet(count) when count in 1..@most do
    mini = div(count, 2)
    Enum.take(@magellans, count - mini) ++ Enum.take(@minis, mini)
  end

  @doc """
  The robots of a number or a list of names; `false` if it is neither.

      iex> {Lab.Scenario.Names.read(2), Lab.Scenario.Names.read([:min7]), Lab.Scenario.Names.read([:dog])}
      {{:ok, [:mag1, :min1]}, {:ok, [:min7]}, false}
  """
  @spec read(term()) :: {:ok, [atom()]} | false
  def read(count) when count in 1..@most, do: {:ok, fleet(count)}

  def read([_ | _] = names) do
    if not List.improper?(names) and names == Enum.uniq(names) and names -- all() == [],
      do: {:ok, names},
      else: false
  end

  def read(_other), do: false
end
