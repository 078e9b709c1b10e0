defmodule Soak.Links do
  @moduledoc """
  Records who reaches whom in a run of `bin/soak`, and since when, by what was done to them. Pure; times in microseconds.

  A robot is here while its node is up and not frozen. What is done to a robot that is here may keep it from
  hearing and speaking for a while: then it counts as here from a later time on (`touch/3`).
  """

  defstruct robots: [], here: %{}, cut: MapSet.new(), joined: %{}, changed: 0

  @type t :: %__MODULE__{}

  @doc "Robots of which none is here yet."
  @spec new([atom()]) :: t()
  def new(robots), do: %__MODULE__{robots: robots, here: Map.new(robots, &{&1, nil})}

  @doc "A robot is here from then on, or again."
  @spec come(t(), atom(), integer()) :: t()
  def come(links, robot, us), do: %{links | here: %{links.here | robot => us}}

  @doc "A robot is here no more."
  @spec go(t(), atom()) :: t()
  def go(links, robot), do: %{links | here: %{links.here | robot => nil}}

  @doc "A robot that is here counts as here only from then on."
  @spec touch(t(), atom(), integer()) :: t()
  def touch(links, robot, us) do
    case links.here[robot] do
      nil -> links
      since -> come(links, robot, max(since, us))
    end
  end

  @doc "These pairs do not reach each other from then on."
  @spec cut(t(), [{atom(), atom()}], integer()) :: t()
  def cut(links, pairs, us),
    do: %{links | cut: MapSet.union(links.cut, MapSet.new(pairs, &pair/1)), changed: us}

  @doc "All links are whole from then on."
  @spec heal(t(), integer()) :: t()
  def heal(links, us) do
    joined = Enum.reduce(links.cut, links.joined, &Map.put(&2, &1, us))
    %{links | cut: MapSet.new(), joined: joined, changed: us}
  end

  @doc """
  Since when two robots reach each other; `nil` if they do not.

      iex> alias Soak.Links
      iex> links = [:a, :b] |> Links.new() |> Links.come(:a, 1) |> Links.come(:b, 2)
      iex> Links.met(links, :b, :a)
      2
      iex> links = Links.cut(links, [{:b, :a}], 3)
      iex> {Links.met(links, :a, :b), Links.met(Links.heal(links, 4), :a, :b)}
      {nil, 4}
  """
  @spec met(t(), atom(), atom()) :: integer() | nil
  def met(links, a, b) do
    link = pair({a, b})
    since = [links.here[a], links.here[b], Map.get(links.joined, link, 0)]
    unless MapSet.member?(links.cut, link) or nil in since, do: Enum.max(since)
  end

  @doc "Who is reached from these robots, directly or by way of others, themselves included if they are here."
  @spec reach(t(), [atom()]) :: [atom()]
  def reach(links, from), do: spread(links, Enum.filter(from, &links.here[&1]), [])

  defp spread(_links, [], reached), do: Enum.sort(reached)

  defp spread(links, [robot | rest], reached) do
    if robot in reached do
      spread(links, rest, reached)
    else
      spread(links, for(other <- links.robots, met(links, robot, other), do: other) ++ rest, [
        robot | reached
      ])
    end
  end

  defp pair({a, b}) when a <= b, do: {a, b}
  defp pair({a, b}), do: {b, a}
end
