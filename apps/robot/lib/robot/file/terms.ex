defmodule Robot.File.Terms do
  @moduledoc """
  Converts the tree of `Robot.File.Reader` to plain values for `Hal.Options`, and finds the lines
  of their keys. Names become existing atoms and modules; a name without one becomes a
  `Robot.File.Terms.Name`, and no atom is created for it.
  """
  alias Hal.ExternalTerm
  alias Hal.Options.ModuleLookup
  alias Hal.Options.Type
  alias Robot.File.Reader

  defmodule Name do
    @moduledoc "A name in a robot file that is not an existing atom, shown as it was written."
    @enforce_keys [:text]
    defstruct @enforce_keys
    @type t :: %__MODULE__{text: String.t()}

    defimpl Inspect do
      def inspect(%{text: text}, _options), do: text
    end
  end

  @type problem :: {line :: pos_integer(), path :: [String.t()], text :: String.t()}

  @doc """
  The value of a tree checked against a type, or all problems, in the order of their lines.

      iex> {:ok, tree} = Robot.File.Reader.read("[lenght: 0.4,\\n width: 900, width: 9]")
      iex> sizes = {:keys, length: {:number, 0.1, 2.0, "m"}, width: {:number, 0.1, 2.0, "m"}}
      iex> Robot.File.Terms.check(tree, sizes)
      {:error, [
        {1, ["lenght"], "is not known: allowed are length, width; did you mean length?"},
        {2, ["width"], "is given twice, first in line 2"},
        {2, ["width"], "expected a number from 0.1 to 2.0 m, got 900"}]}
  """
  @spec check(Reader.tree(), Type.t()) :: {:ok, term()} | {:error, [problem(), ...]}
  def check(tree, type) do
    case {twice(tree, []), Type.read(type, term(tree))} do
      {[], {:ok, value}} ->
        {:ok, value}

      {twice, {:ok, _value}} ->
        {:error, twice}

      {twice, {:error, problems}} ->
        {:error, Enum.sort_by(twice ++ at(problems, tree), &elem(&1, 0))}
    end
  end

  @doc "Adds to each problem the line of its key, or of what would contain a missing key."
  @spec at([Type.problem()], Reader.tree()) :: [problem()]
  def at(problems, tree), do: for({path, text} <- problems, do: {line(tree, path), path, text})

  @doc """
  The value of a tree; if a key is given twice, the first one counts.

      iex> {:ok, tree} = Robot.File.Reader.read("[arm: :manual, id: :no_robot_of_ours]")
      iex> inspect(Robot.File.Terms.term(tree))
      "[arm: :manual, id: :no_robot_of_ours]"
  """
  @spec term(Reader.tree()) :: term()
  def term({_line, {:list, nodes}}), do: Enum.map(nodes, &term/1)
  def term({_line, {:tuple, nodes}}), do: nodes |> Enum.map(&term/1) |> List.to_tuple()
  def term({_line, {:map, pairs}}), do: Map.new(pairs, fn {k, v} -> {term(k), term(v)} end)

  def term({_line, {:name, name}}), do: known(name, %Name{text: ":" <> name})

  # The options of a driver follow its name. Calling its table loads the names of these options as
  # atoms before they are looked up.
  def term({_line, {:module, name}}) do
    with {:ok, module} <- ModuleLookup.module(name) do
      if function_exported?(module, :option_table, 0), do: module.option_table()
      module
    else
      :error -> %Name{text: name}
    end
  end

  def term({_line, {:keys, keys}}) do
    for {name, _line, node} <- Enum.uniq_by(keys, &elem(&1, 0)),
        do: {known(name, name), term(node)}
  end

  def term({_line, value}), do: value

  @doc "The first name in a value that is not an existing atom, however deep; `nil` without one."
  @spec strange(term()) :: Name.t() | nil
  def strange(%Name{} = name), do: name
  def strange([_ | _] = list), do: Enum.find_value(list, &strange/1)
  def strange(tuple) when is_tuple(tuple), do: tuple |> Tuple.to_list() |> strange()
  def strange(map) when is_map(map) and not is_struct(map), do: map |> Map.to_list() |> strange()
  def strange(_value), do: nil

  defp known(name, otherwise) do
    case ExternalTerm.atom(name) do
      {:ok, atom} -> atom
      :error -> otherwise
    end
  end

  defp twice({_line, {:keys, keys}}, path) do
    for {{name, line, node}, n} <- Enum.with_index(keys), reduce: [] do
      problems ->
        first = Enum.find(Enum.take(keys, n), &(elem(&1, 0) == name))
        text = first && "is given twice, first in line #{elem(first, 1)}"
        own = if first, do: [{line, path ++ [name], text}], else: twice(node, path ++ [name])
        problems ++ own
    end
  end

  defp twice({_line, {kind, nodes}}, path) when kind in [:list, :tuple],
    do: Enum.flat_map(nodes, &twice(&1, path))

  defp twice(_node, _path), do: []

  defp line({line, _value}, []), do: line

  defp line({line, value}, [key | path]) do
    case below(value, key) do
      nil -> line
      node -> line(node, path)
    end
  end

  defp below({:keys, keys}, key) do
    Enum.find_value(keys, fn {name, line, node} -> name == key && {line, elem(node, 1)} end)
  end

  # The options of a driver follow its name in the tuple.
  defp below({:tuple, nodes}, key), do: nodes |> List.last() |> elem(1) |> below(key)

  defp below({:map, pairs}, key),
    do: Enum.find_value(pairs, &(elem(elem(&1, 0), 1) == key && elem(&1, 1)))

  # The reader gives `[]` as a plain list, so the key may not be an index.
  defp below({:list, nodes}, n) do
    with {place, ""} when place > 0 <- Integer.parse(n),
         do: Enum.at(nodes, place - 1),
         else: (_key -> nil)
  end

  defp below(_value, _key), do: nil
end
