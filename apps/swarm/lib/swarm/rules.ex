defmodule Swarm.Rules do
  @moduledoc """
  Draws conclusions from facts by rules, as a function: what a group should do, from what its robots know of each other and of the
  world. A conclusion is a proposal to a mission, which decides; it holds the facts that led to it, so that a person can ask why.

      defmodule Help do
        use Swarm.Rules

        rule "a free robot takes the point of one that is blocked", priority: 10 do
          blocked(robot, point)
          free(helper, far_m)
          where helper != robot and far_m < 8
          absent visits(_other, point)
          propose take(helper, point)
        end
      end

      Swarm.Rules.run(Help.rules(), [{:blocked, :mag1, 3}, {:free, :mag2, 2.5}])

  A fact is a tuple: a name, and up to 6 values (numbers, names, text). In a rule

  | line | holds |
  |---|---|
  | `blocked(robot, point)` | for each fact of this name; a word is a variable, the same everywhere in the rule; `_other` is any value |
  | `where helper != robot and far_m < 8` | comparisons of variables and values, joined by `and` |
  | `absent visits(_other, point)` | if there is no such fact among those that were given; conclusions do not count |
  | `conclude needs_help(robot)` | then this is a fact, too, for other rules |
  | `propose take(helper, point)` | then this is proposed |

  Conclusions are drawn anew from the facts at each call, so they vanish with their grounds. Proposals come by priority, the
  greatest first, then in the order of the rules, then of the facts. Matching is naive, with an index by name and first value:
  100 rules and 500 facts take about a millisecond (`docs/results.md`).

  A file of the same shape is read by `Swarm.Rules.Reader.file/1`, and nothing in it is run.
  """
  alias Swarm.Rules.{Reader, Rule}

  @most_facts 5_000
  @most_rounds 20

  @type fact :: tuple()

  @typedoc "What was concluded or proposed: by which rule, and from which facts, in the order of its lines."
  @type conclusion :: %{
          fact: fact(),
          rule: String.t(),
          priority: integer(),
          because: [fact()],
          kind: :conclude | :propose
        }

  @typedoc "Proposals in their order, and the conclusions by fact, for `why/2`."
  @type result :: %{proposals: [conclusion()], conclusions: %{fact() => conclusion()}}

  defmacro __using__(_options) do
    quote do
      import Swarm.Rules, only: [rule: 2, rule: 3]
      Module.register_attribute(__MODULE__, :swarm_rules, accumulate: true)
      @before_compile Swarm.Rules
    end
  end

  defmacro __before_compile__(_env) do
    quote do
      @doc "The rules of this module, in their order."
      @spec rules() :: [Swarm.Rules.Rule.t()]
      def rules, do: Enum.reverse(@swarm_rules)
    end
  end

  @doc "A rule; `priority:` is a whole number (0)."
  defmacro rule(name, options \\ [], do: block) do
    case Reader.rule(name, options, block) do
      {:ok, rule} -> quote(do: @swarm_rules(unquote(Macro.escape(rule))))
      {:error, line} -> raise ArgumentError, "rule #{inspect(name)}: #{line}"
    end
  end

  @doc """
  What follows from the facts; the error says that too much does.

      iex> {:ok, rules} = Swarm.Rules.Reader.text(~S|
      ...>   rule "near", priority: 2 do
      ...>     at(robot, x)
      ...>     where x < 1
      ...>     conclude near(robot)
      ...>   end
      ...>   rule "two" do
      ...>     near(a)
      ...>     near(b)
      ...>     where a < b
      ...>     propose meet(a, b)
      ...>   end
      ...> |)
      iex> {:ok, result} = Swarm.Rules.run(rules, [{:at, :mag1, 0.5}, {:at, :mag2, 0.2}, {:at, :mag3, 4}])
      iex> for %{fact: fact, because: because} <- result.proposals, do: {fact, because}
      [{{"meet", :mag1, :mag2}, [{"near", :mag1}, {"near", :mag2}]}]
      iex> Swarm.Rules.why(result, {"meet", :mag1, :mag2})
      ["meet(mag1, mag2), by \\"two\\"", "  near(mag1), by \\"near\\"", "    at(mag1, 0.5)", "  near(mag2), by \\"near\\"", "    at(mag2, 0.2)"]
  """
  @spec run([Rule.t()], [fact()]) :: {:ok, result()} | {:error, line :: String.t()}
  def run(rules, facts) do
    given = facts |> Enum.map(&named/1) |> Enum.uniq()
    rules = rules |> Enum.with_index() |> Enum.sort_by(fn {rule, k} -> {-rule.priority, k} end)
    given = known(%{}, given)
    s = %{given: given, facts: given, new: [], found: %{}, proposals: [], count: 0}
    rounds(rules, s, @most_rounds)
  end

  # Names as text: those of a file make no atoms.
  defp named(fact) when is_tuple(fact) and tuple_size(fact) in 1..7 do
    case elem(fact, 0) do
      name when is_atom(name) -> put_elem(fact, 0, Atom.to_string(name))
      name when is_binary(name) -> fact
    end
  end

  # Those of a key are in their order, whatever the order was in which they were given.
  defp known(index, facts), do: facts |> Enum.sort(:desc) |> Enum.reduce(index, &put/2)

  defp put(fact, index) do
    [name | values] = Tuple.to_list(fact)
    size = length(values) + 1
    index = Map.update(index, {name, size}, [fact], &[fact | &1])

    case values do
      [first | _] -> Map.update(index, {name, size, first}, [fact], &[fact | &1])
      [] -> index
    end
  end

  defp rounds(_rules, _s, 0),
    do: {:error, "the rules go on concluding after #{@most_rounds} rounds"}

  defp rounds(_rules, %{count: count}, _left) when count > @most_facts, do: too_many()

  defp rounds(rules, s, left) do
    # What a round finds counts from the next one on, so that the order of the rules does not matter for what is found.
    next = Enum.reduce(rules, s, fn {rule, _k}, next -> fire(rule, s, next) end)

    cond do
      next.count > @most_facts ->
        too_many()

      next.new != [] ->
        rounds(rules, %{next | facts: known(s.facts, next.new), new: []}, left - 1)

      true ->
        {:ok, %{proposals: ordered(next.proposals), conclusions: next.found}}
    end
  end

  defp too_many, do: {:error, "the rules conclude more than #{@most_facts} facts"}

  defp ordered(proposals),
    do: proposals |> Enum.reverse() |> Enum.sort_by(&(-&1.priority)) |> Enum.uniq_by(& &1.fact)

  defp fire(rule, s, next) do
    for {bound, because} <- matches(rule.lines, s, [{%{}, []}]),
        {kind, pattern} <- rule.then,
        reduce: next do
      next -> found(next, kind, filled(pattern, bound), rule, Enum.reverse(because))
    end
  end

  # What a later round proposes by a rule that is worth more counts.
  defp found(next, kind, fact, rule, because) do
    before = next.found[{kind, fact}]

    if before && (kind == :conclude or before.priority >= rule.priority) do
      next
    else
      conclusion = %{
        fact: fact,
        rule: rule.name,
        priority: rule.priority,
        because: because,
        kind: kind
      }

      next = %{next | found: Map.put(next.found, {kind, fact}, conclusion), count: next.count + 1}

      if kind == :propose,
        do: %{next | proposals: [conclusion | next.proposals]},
        else: %{next | new: [fact | next.new]}
    end
  end

  # Each way in which the lines hold, with the facts that it took, newest first.
  defp matches([], _s, ways), do: ways

  defp matches([{:fact, pattern} | rest], s, ways) do
    ways =
      for {bound, because} <- ways,
          fact <- candidates(s.facts, pattern, bound),
          bound = fits(pattern, fact, bound),
          do: {bound, [fact | because]}

    matches(rest, s, ways)
  end

  defp matches([{:absent, pattern} | rest], s, ways) do
    none? = fn {bound, _because} ->
      not Enum.any?(candidates(s.given, pattern, bound), &fits(pattern, &1, bound))
    end

    matches(rest, s, Enum.filter(ways, none?))
  end

  defp matches([{:where, tests} | rest], s, ways) do
    holds? = fn {bound, _because} -> Enum.all?(tests, &holds?(&1, bound)) end
    matches(rest, s, Enum.filter(ways, holds?))
  end

  defp candidates(index, [name | values], bound) do
    size = length(values) + 1

    case values do
      [first | _] -> Map.get(index, key(name, size, first, bound), [])
      [] -> Map.get(index, {name, size}, [])
    end
  end

  defp key(name, size, {:var, var}, bound) when is_map_key(bound, var),
    do: {name, size, bound[var]}

  defp key(name, size, {:value, value}, _bound) when not is_tuple(value), do: {name, size, value}
  defp key(name, size, _open, _bound), do: {name, size}

  defp fits([_name | values], fact, bound), do: fits(values, fact, 1, bound)

  defp fits([], _fact, _k, bound), do: bound
  defp fits([:any | rest], fact, k, bound), do: fits(rest, fact, k + 1, bound)

  defp fits([{:var, var} | rest], fact, k, bound) do
    value = elem(fact, k)

    case bound do
      %{^var => ^value} -> fits(rest, fact, k + 1, bound)
      %{^var => _other} -> nil
      _free -> fits(rest, fact, k + 1, Map.put(bound, var, value))
    end
  end

  defp fits([{:value, value} | rest], fact, k, bound),
    do: if(same?(value, elem(fact, k)), do: fits(rest, fact, k + 1, bound))

  # A name in a file is text.
  defp same?({:name, text}, value), do: is_atom(value) and Atom.to_string(value) == text
  defp same?(value, value), do: true
  defp same?(_one, _other), do: false

  defp holds?({op, left, right}, bound) do
    {left, right} = {value(left, bound), value(right, bound)}

    case op do
      :== -> same?(left, right) or same?(right, left)
      :!= -> not (same?(left, right) or same?(right, left))
      # Of what has no order nothing holds.
      op when is_number(left) and is_number(right) -> apply(Kernel, op, [left, right])
      op when is_atom(left) and is_atom(right) -> apply(Kernel, op, [left, right])
      op when is_binary(left) and is_binary(right) -> apply(Kernel, op, [left, right])
      _op -> false
    end
  end

  defp value({:var, var}, bound), do: Map.fetch!(bound, var)
  defp value({:value, value}, _bound), do: value

  defp filled([name | values], bound),
    do: List.to_tuple([name | Enum.map(values, &value(&1, bound))])

  @doc "How a fact came about, a line each, indented below what it led to; one that was given is a line of its own."
  @spec why(result(), fact()) :: [line :: String.t()]
  def why(result, fact), do: why(result, named(fact), "")

  defp why(result, fact, indent) do
    case result.conclusions[{:propose, fact}] || result.conclusions[{:conclude, fact}] do
      nil ->
        [indent <> words(fact)]

      %{rule: rule, because: because} ->
        grounds = Enum.flat_map(because, &why(result, &1, indent <> "  "))
        ["#{indent}#{words(fact)}, by #{inspect(rule)}" | grounds]
    end
  end

  defp words(fact) do
    [name | values] = Tuple.to_list(fact)
    "#{name}(#{Enum.map_join(values, ", ", &word/1)})"
  end

  defp word({:name, text}), do: text
  defp word(value) when is_atom(value), do: Atom.to_string(value)
  defp word(value), do: inspect(value)
end
