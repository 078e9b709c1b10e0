defmodule Robot.File.Check do
  @moduledoc """
  Compares what `Robot.File.Reader` read with what is allowed, and names all that is wrong. Pure.

  What is allowed is a value:

  | check | takes | gives |
  |---|---|---|
  | `{:number, low, high, unit}` | a number | a float |
  | `{:whole, low, high}` | a whole number | the number |
  | `:boolean` | `true`, `false` | the same |
  | `{:text, what}` | text of 1 to 255 characters that can be printed | the same |
  | `{:one_of, atoms}` | one of these names | the atom |
  | `:pose` | `{x, y, heading}`, metres and radians | `Hal.Pose` |
  | `{:list, check, most}` | up to so many values in brackets | a list |
  | `{:keys, [{key, check}]}` | `[key: value, …]` | a keyword list in the order of the table |
  | `{:or, value, check}` | that value, or what the check takes | |
  | `{:with, function}` | what `function.(node, path)` takes | |
  """
  alias Hal.{Pose, Suggest}
  alias Robot.File.{Printer, Reader}

  @farthest 10_000

  @type check :: atom() | tuple()
  @type problem :: {line :: pos_integer(), path :: [String.t()], text :: String.t()}
  @type result :: {:ok, term()} | {:error, [problem(), ...]}

  @doc """
  The value of a node, or all its problems; `path` are the keys that lead to it.

      iex> node = {3, {:keys, [{"lenght", 3, {3, 0.4}}, {"width", 4, {4, 900}}]}}
      iex> sizes = {:keys, length: {:number, 0.1, 2.0, "m"}, width: {:number, 0.1, 2.0, "m"}}
      iex> Robot.File.Check.run(sizes, node, ["body"])
      {:error, [
        {3, ["body", "lenght"], "is not a key; did you mean length?"},
        {4, ["body", "width"], "cannot be 900: a number from 0.1 to 2.0 m is allowed"}]}
      iex> Robot.File.Check.run({:one_of, [:manual, :auto]}, {1, {:name, "auto"}}, [])
      {:ok, :auto}
  """
  @spec run(check(), Reader.tree(), [String.t()]) :: result()
  def run({:or, value, _check}, {_line, value}, _path), do: {:ok, value}
  def run({:or, _value, check}, node, path), do: run(check, node, path)
  def run({:with, function}, node, path), do: function.(node, path)

  def run({:number, low, high, _unit}, {_line, value}, _path)
      when is_number(value) and value >= low and value <= high,
      do: {:ok, value * 1.0}

  def run({:whole, low, high}, {_line, value}, _path)
      when is_integer(value) and value >= low and value <= high,
      do: {:ok, value}

  def run(:boolean, {_line, value}, _path) when is_boolean(value), do: {:ok, value}

  def run({:text, _what} = check, {_line, value} = node, path) when is_binary(value) do
    if value != "" and String.printable?(value) and String.length(value) <= 255 and
         not (value =~ ~r/[\r\n]/),
       do: {:ok, value},
       else: refuse(check, node, path)
  end

  def run({:one_of, atoms} = check, {_line, {:name, name}} = node, path) do
    case Enum.find(atoms, &(Atom.to_string(&1) == name)) do
      nil -> refuse(check, node, path, meant(name, atoms, ":"))
      atom -> {:ok, atom}
    end
  end

  def run(:pose, {_line, {:tuple, [{_, x}, {_, y}, {_, heading}]}}, _path)
      when is_number(x) and is_number(y) and is_number(heading) and abs(x) <= @farthest and
             abs(y) <= @farthest and abs(heading) <= 100,
      do: {:ok, Pose.new(x, y, heading)}

  def run({:list, check, most}, {_line, {:list, nodes}}, path) when length(nodes) <= most do
    nodes
    |> Enum.with_index(1)
    |> Enum.map(fn {node, n} -> run(check, node, path ++ ["#{n}"]) end)
    |> all()
  end

  def run({:keys, _table} = check, {line, {:list, []}}, path),
    do: run(check, {line, {:keys, []}}, path)

  def run({:keys, table}, {_line, {:keys, keys}}, path) do
    known = Keyword.keys(table)
    names = Enum.map(known, &Atom.to_string/1)

    wrong =
      for {name, line, _node} <- keys, name not in names do
        {line, path ++ [name], "is not a key#{meant(name, known, "")}#{choice(name, known)}"}
      end

    found = Enum.map(table, fn {key, check} -> {key, find(check, keys, key, path)} end)
    problems = wrong ++ for {_key, {:error, problems}} <- found, problem <- problems, do: problem
    values = for {key, {:ok, value}} <- found, do: {key, value}
    if problems == [], do: {:ok, values}, else: {:error, Enum.sort_by(problems, &elem(&1, 0))}
  end

  def run(check, node, path), do: refuse(check, node, path)

  @doc "Joins results: all values, or all problems."
  @spec all([result()]) :: {:ok, [term()]} | {:error, [problem(), ...]}
  def all(results) do
    case for {:error, problems} <- results, problem <- problems, do: problem do
      [] -> {:ok, Enum.map(results, &elem(&1, 1))}
      problems -> {:error, problems}
    end
  end

  @doc "What a check allows, for people."
  @spec allowed(check()) :: String.t()
  def allowed({:number, low, high, unit}),
    do: "a number from #{low} to #{high} #{unit} is allowed"

  def allowed({:whole, low, high}), do: "a whole number from #{low} to #{high} is allowed"
  def allowed(:boolean), do: "true or false is allowed"
  def allowed({:text, what}), do: "#{what} is allowed"
  def allowed({:one_of, atoms}), do: "allowed: #{list(atoms, ":")}"
  def allowed({:list, _check, most}), do: "a list of up to #{most} is allowed"

  def allowed({:keys, table}),
    do: "[key: value, …] with #{list(Keyword.keys(table), "")} is allowed"

  def allowed({:or, value, check}), do: "#{inspect(value)}, or #{allowed(check)}"

  def allowed(:pose),
    do:
      "{x, y, heading} is allowed, metres up to #{@farthest} and radians, such as {1.0, 0.5, deg(90)}"

  @doc "The problem of a node that a check does not take."
  @spec refuse(check() | String.t(), Reader.tree(), [String.t()], hint :: String.t()) ::
          {:error, [problem(), ...]}
  def refuse(check, {line, _value} = node, path, hint \\ "") do
    allowed = if is_binary(check), do: check, else: allowed(check)
    {:error, [{line, path, "cannot be #{Printer.show(node)}: #{allowed}#{hint}"}]}
  end

  @doc """
  The half-sentence that suggests what a word was meant for, if anything is like it.

      iex> Robot.File.Check.meant("manaul", [:manual, :auto], ":")
      "; did you mean :manual?"
  """
  @spec meant(String.t(), [atom() | String.t()], prefix :: String.t()) :: String.t()
  def meant(word, known, prefix) do
    case Suggest.nearest(word, Enum.map(known, &to_string/1)) do
      nil -> ""
      near -> "; did you mean #{prefix}#{near}?"
    end
  end

  defp choice(name, known),
    do: if(meant(name, known, "") == "", do: ": there are #{list(known, "")}", else: "")

  defp find(check, keys, key, path) do
    name = Atom.to_string(key)

    case Enum.filter(keys, fn {given, _line, _node} -> given == name end) do
      [] ->
        :absent

      [{_name, _line, node}] ->
        run(check, node, path ++ [name])

      [{_name, first, _node} | more] ->
        {_name, line, _node} = List.last(more)
        {:error, [{line, path ++ [name], "is given twice, first in line #{first}"}]}
    end
  end

  defp list(atoms, prefix), do: Enum.map_join(atoms, ", ", &"#{prefix}#{&1}")
end
