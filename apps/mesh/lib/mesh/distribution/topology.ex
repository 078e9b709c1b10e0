defmodule Mesh.Distribution.Topology do
  @moduledoc false
  # Chooses the nodes that a node connects its distribution to. Pure: all nodes compute the same from the known nodes.
  #
  # Up to `full_mesh` nodes, every node connects to every other. Above that, the names in order form
  # a ring with chords: each node connects to those 1, n^(1/4), n^(1/2) and n^(3/4) places further
  # on, and so to as many before it; with a hundred nodes no two are more than seven steps apart,
  # and each has at most eight connections.
  #
  # Of each pair the node whose name comes first dials; the other does so if that has not happened.

  @doc """
  The nodes that `me` should be connected to, sorted.

      iex> Mesh.Distribution.Topology.peers("a", ["b", "c"], 30, 8)
      ["b", "c"]
      iex> names = for n <- 100..199, do: "mag\#{n}"
      iex> length(Mesh.Distribution.Topology.peers("mag100", names, 30, 8))
      8
  """
  @spec peers(String.t(), [String.t()], pos_integer(), pos_integer()) :: [String.t()]
  def peers(me, known, full_mesh, degree) do
    all = Enum.sort(Enum.uniq([me | known]))
    count = length(all)
    if count <= full_mesh, do: List.delete(all, me), else: chords(me, all, count, degree)
  end

  @doc "Whether `me` is the one of the two that dials."
  @spec dials?(String.t(), String.t()) :: boolean()
  def dials?(me, other), do: me < other

  @doc """
  A shortest route through connections from `me` to `target`, without `me`; `nil` if there is
  none.

      iex> Mesh.Distribution.Topology.route("a", "c", %{"a" => ["b"], "b" => ["a", "c"]})
      ["b", "c"]
  """
  @spec route(name, name, %{name => [name]}) :: [name] | nil when name: term()
  def route(me, target, links), do: search([[me]], target, links, MapSet.new([me]))

  defp chords(me, all, count, degree) do
    place = Enum.find_index(all, &(&1 == me))
    steps = div(degree, 2)

    for k <- 0..(steps - 1)//1, sign <- [1, -1] do
      far = round(:math.pow(count, k / steps))
      Enum.at(all, Integer.mod(place + sign * far, count))
    end
    |> Enum.uniq()
    |> List.delete(me)
    |> Enum.sort()
  end

  defp search([], _target, _links, _seen), do: nil

  defp search(paths, target, links, seen) do
    case Enum.find(paths, &(hd(&1) == target)) do
      nil ->
        {next, seen} = further(paths, links, seen)
        search(next, target, links, seen)

      path ->
        path |> Enum.reverse() |> tl()
    end
  end

  defp further(paths, links, seen) do
    for [here | _] = path <- paths, name <- Map.get(links, here, []), reduce: {[], seen} do
      {next, seen} ->
        if name in seen,
          do: {next, seen},
          else: {next ++ [[name | path]], MapSet.put(seen, name)}
    end
  end
end
