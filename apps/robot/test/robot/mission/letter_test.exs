defmodule Robot.Mission.LetterTest do
  @moduledoc "A mission says and hears its own messages through one door, which its table guards."
  use ExUnit.Case, async: true
  alias Robot.Mission.{Letter, Runner}
  doctest Robot.Mission
  doctest Letter

  defmodule Talks do
    @behaviour Robot.Mission

    @impl Robot.Mission
    def messages, do: {3, seen: [point: [{:integer, 0, 9}, required: true]], round: :shared}

    @impl Robot.Mission
    def commands, do: [:louder]

    @impl Robot.Mission
    def init(_robot, _options), do: {:ready, [], []}

    @impl Robot.Mission
    def handle({:command, {:say, kind, fields}}, heard),
      do: {:ready, heard, [{:tell, [:mag2], kind, fields}]}

    def handle({:message, message}, heard), do: {:ready, [message | heard], []}
  end

  defp runner, do: elem(Runner.start(Runner.new(:mag1), Talks, []), 0)
  defp say(kind, fields), do: Runner.handle(runner(), {:command, {:say, kind, fields}})

  test "what it says is a letter of its mission and version, and is heard as its kind" do
    {_runner, [{:send, [:mag2], letter}]} = say(:seen, point: 3)

    assert letter == %Letter{
             to: [:mag2],
             mission: Talks,
             version: 3,
             kind: :seen,
             fields: [point: 3]
           }

    message = %{from: :mag2, kind: :mission, body: letter, hops: 0}
    {runner, []} = Runner.handle(runner(), {:message, message})
    assert runner.mission == [%{from: :mag2, kind: :seen, body: [point: 3], hops: 0}]

    for from <- [nil, "mag2", 5] do
      {runner, []} = Runner.handle(runner(), {:message, %{message | from: from}})
      assert {runner.mission, runner.refused} == {[], 1}
    end
  end

  test "what its own table does not allow is the mission's fault" do
    assert_raise ArgumentError, ~r/message :seen option point: expected .*, got 10/, fn ->
      say(:seen, point: 10)
    end

    assert_raise ArgumentError, ~r/no message of its own :round/, fn -> say(:round, []) end
    assert_raise ArgumentError, ~r/no message of its own :shout/, fn -> say(:shout, []) end
  end

  test "it hears the shared messages that it names, and no others" do
    for {kind, heard} <- [round: 1, place: 0] do
      {runner, []} = Runner.handle(runner(), {:message, %{from: :mag2, kind: kind, body: :any}})
      assert {length(runner.mission), runner.refused} == {heard, 1 - heard}
    end
  end

  test "a command that a mission does not name finds no way to it" do
    alias Robot.Control.Delivery

    open = fn name, state ->
      Delivery.way(
        %Delivery{ways: [{:hand, {:taking, name}}], until_ms: 0, reply: {Kernel, :send, []}},
        state,
        nil
      )
    end

    assert open.(:louder, {Talks, :ready}) == {:ok, {:hand, Talks}}
    assert open.(:formation, {Talks, :ready}) == {:error, :idle}
    assert open.(:louder, :idle) == {:error, :idle}
  end
end
