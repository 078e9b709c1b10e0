defmodule Agents.TemplateTest do
  use ExUnit.Case, async: true
  doctest Agents
  doctest Agents.Template
  alias Agents.{Envelope, Template}

  defp envelope do
    Envelope.new(:inform, :mag1, {:battery, 11.8},
      conversation: {:mag1, 4},
      topic: "power",
      epoch: 2
    )
  end

  test "fields, and, or, not" do
    for {template, wanted} <- [
          {[], true},
          {[performative: :inform], true},
          {[performative: :request], false},
          {[performative: [:request, :inform], from: :mag1], true},
          {[performative: :inform, from: :mag2], false},
          {[conversation: {:mag1, 4}, topic: "power", epoch: 2, class: :data], true},
          {[epoch: nil], false},
          {[reply_to: nil, in_reply_to: nil], true},
          {[content: {:battery, 11.8}], true},
          {[content: {:battery, 12}], false},
          {[content: &match?({:battery, volts} when volts < 12, &1)], true},
          {[content: fn _ -> :not_true end], false},
          {{:any, [[from: :mag2], [topic: "power"]]}, true},
          {{:any, []}, false},
          {{:all, []}, true},
          {{:all, [[from: :mag1], {:not, [topic: "power"]}]}, false},
          {{:not, {:any, [[from: :mag2], [from: :mag3]]}}, true}
        ] do
      assert Template.check(template) == {:ok, template}
      assert Template.match?(template, envelope()) == wanted, inspect(template)
    end
  end

  test "a term that is not a template is an error of one line" do
    for bad <- [
          :inform,
          nil,
          %{from: :mag1},
          [:from],
          [{"from", :mag1}],
          [from: :mag1, speed: 1],
          [{:from, :mag1} | :tail],
          {:any, :x},
          {:any, [[from: :mag1], :x]},
          {:all, [[] | []] ++ [{:not, 5}]},
          {:all, [[] | :x]},
          {:xor, [[], []]},
          {:not, [], []}
        ] do
      assert {:error, line} = Template.check(bad)
      refute line =~ "\n"
    end
  end

  test "not, and, or follow logic, whatever they combine" do
    leaf = fn -> Enum.random([[], [from: :mag1], [from: :mag2], [epoch: [1, 2]], [topic: :x]]) end
    it = envelope()

    for _ <- 1..500 do
      [a, b] = [{:any, [leaf.(), leaf.()]}, {:all, [leaf.(), {:not, leaf.()}]}]
      [x, y] = [Template.match?(a, it), Template.match?(b, it)]
      assert Template.match?({:not, a}, it) == not x
      assert Template.match?({:all, [a, b]}, it) == (x and y)
      assert Template.match?({:any, [a, b]}, it) == (x or y)
    end
  end
end
