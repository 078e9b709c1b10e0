defmodule Swarm.RulesTest do
  use ExUnit.Case, async: true
  doctest Swarm.Rules
  doctest Swarm.Rules.Reader
  alias Swarm.Rules
  alias Swarm.Rules.Reader

  defmodule Help do
    use Swarm.Rules

    rule "a free robot takes the point of one that is blocked", priority: 10 do
      blocked(robot, point)
      free(helper, far_m)
      where(helper != robot and far_m < 8)
      absent(visits(_other, point))
      propose(take(helper, point))
    end

    rule "one without work is free" do
      rests(robot, far_m)
      conclude(free(robot, far_m))
    end

    rule "the rest waits" do
      rests(robot, _far_m)
      propose(wait(robot))
    end
  end

  @facts [{:blocked, :mag1, 3}, {:rests, :mag2, 2.5}, {:rests, :mag3, 12.0}]

  defp proposed({:ok, result}), do: for(%{fact: fact} <- result.proposals, do: fact)

  test "conclusions serve other rules, priority goes first, then the order of rules and facts" do
    assert proposed(Rules.run(Help.rules(), @facts)) ==
             [{"take", :mag2, 3}, {"wait", :mag2}, {"wait", :mag3}]

    # Whatever the order of the facts, and however often one is given.
    for facts <- [Enum.reverse(@facts), @facts ++ @facts],
        do: assert(Rules.run(Help.rules(), facts) == Rules.run(Help.rules(), @facts))
  end

  test "what two rules propose has the greater priority, also where its grounds are concluded later" do
    {:ok, rules} =
      Rules.Reader.text("""
      rule "near" do
        at(robot)
        propose go(robot)
      end
      rule "called", priority: 5 do
        called(robot)
        propose go(robot)
      end
      rule "heard", priority: 1 do
        heard(robot)
        conclude called(robot)
      end
      """)

    {:ok, result} = Rules.run(rules, at: 1, at: 2, heard: 2)

    assert [%{fact: {"go", 2}, priority: 5, rule: "called"}, %{fact: {"go", 1}, priority: 0}] =
             result.proposals

    assert [~s|go(2), by "called"| | _because] = Rules.why(result, {:go, 2})
  end

  test "a conclusion vanishes with its grounds, and absent looks at what was given" do
    assert proposed(Rules.run(Help.rules(), tl(@facts))) == [{"wait", :mag2}, {"wait", :mag3}]
    visited = [{:visits, :min1, 3} | @facts]
    refute {"take", :mag2, 3} in proposed(Rules.run(Help.rules(), visited))
    other = [{:visits, :min1, 4} | @facts]
    assert {"take", :mag2, 3} in proposed(Rules.run(Help.rules(), other))
  end

  test "each proposal has its facts, and says why in words" do
    {:ok, result} = Rules.run(Help.rules(), @facts)
    assert [%{because: because, rule: "a free robot" <> _, priority: 10} | _] = result.proposals
    assert because == [{"blocked", :mag1, 3}, {"free", :mag2, 2.5}]

    assert Rules.why(result, {:take, :mag2, 3}) == [
             ~s|take(mag2, 3), by "a free robot takes the point of one that is blocked"|,
             "  blocked(mag1, 3)",
             ~s|  free(mag2, 2.5), by "one without work is free"|,
             "    rests(mag2, 2.5)"
           ]
  end

  @file_of_help """
  rule "a free robot takes the point of one that is blocked", priority: 10 do
    blocked(robot, point)
    free(helper, far_m)
    where helper != robot and far_m < 8
    absent visits(_other, point)
    propose take(helper, point)
  end

  rule "one without work is free" do
    rests(robot, far_m)
    conclude free(robot, far_m)
  end

  rule "the rest waits" do
    rests(robot, _far_m)
    propose wait(robot)
  end
  """

  @tag :tmp_dir
  test "a file says the same as a module, and makes no atoms", %{tmp_dir: folder} do
    path = Path.join(folder, "help.exs")
    File.write!(path, @file_of_help)
    {:ok, rules} = Reader.file(path)
    assert Rules.run(rules, @facts) == Rules.run(Help.rules(), @facts)

    strange =
      "rule \"a\" do\n  zqxj_fact(zqxj_variable, :zqxj_name)\n  propose zqxj_go(zqxj_variable)\nend"

    before = :erlang.system_info(:atom_count)
    assert {:ok, rules} = Reader.text(strange)
    assert {:ok, %{proposals: []}} = Rules.run(rules, @facts)
    assert :erlang.system_info(:atom_count) == before
    # A name of a file is that of a fact.
    {:ok, rules} =
      Reader.text("rule \"b\" do\n  is(robot, :mag1)\n  propose go(robot, :home)\nend")

    {:ok, result} = Rules.run(rules, [{:is, 1, :mag1}, {:is, 2, :mag2}])
    assert [%{fact: {"go", 1, {:name, "home"}}}] = result.proposals
  end

  @tag :tmp_dir
  test "what is wrong with a file is one line, with its number", %{tmp_dir: folder} do
    for {text, line} <- [
          {"rule \"a\" do\n  at(x)\nend",
           "1: rule \"a\": expected a line with conclude or propose"},
          {"rule \"a\" do\n  propose go(1)\nend", "1: rule \"a\": expected a fact"},
          {"\n\nsystem(\"rm\")", "3: expected rule"},
          {"rule a do\n at(x)\nend", "1: rule"},
          {"rule \"a\", speed: 1 do\n at(x)\n propose go(x)\nend", "priority: a whole number"},
          {"rule \"a\" do\n at(x)\n where x + 1\n propose go(x)\nend",
           "where: expected comparisons"},
          {"rule \"a\" do\n at(x)\n where y < 1\n propose go(x)\nend",
           "y in where is in no line before it"},
          {"rule \"a\" do\n at(x)\n propose go(_y)\nend", "_ in propose says nothing"},
          {"rule \"a\" do\n at(%{})\n propose go(1)\nend", "expected a fact"},
          {"rule \"a\" do", "1: this is not Elixir's notation"},
          {"rule(", "1: this is not Elixir's notation"}
        ] do
      assert {:error, said} = Reader.text(text)
      assert said =~ line
    end

    missing = Path.join(folder, "none.exs")
    assert Reader.file(missing) == {:error, "#{missing}: no such file or directory"}
    large = Path.join(folder, "large.exs")
    File.write!(large, String.duplicate(" ", 200_001))
    assert {:error, line} = Reader.file(large)
    assert line =~ "at most 200000 bytes"
  end

  test "rules that go on for ever end in one line, and what has no order is not compared" do
    {:ok, rules} = Reader.text("rule \"a\" do\n  n(x)\n  n(y)\n  conclude pair(x, y)\nend")
    many = for n <- 1..100, do: {:n, n}
    assert {:error, "the rules conclude more than 5000 facts"} = Rules.run(rules, many)

    {:ok, rules} = Reader.text("rule \"a\" do\n  n(x)\n  where x < 5\n  propose small(x)\nend")
    facts = [{:n, 3}, {:n, :mag1}, {:n, "a"}, {:n, 7}]
    assert proposed(Rules.run(rules, facts)) == [{"small", 3}]
  end

  test "a rule of a module that is wrong does not compile" do
    code = """
    defmodule Swarm.RulesTest.Wrong do
      use Swarm.Rules
      rule "a" do
        at(x)
        propose go(y)
      end
    end
    """

    assert_raise ArgumentError, ~r/rule "a": y in propose/, fn -> Code.compile_string(code) end
  end
end
