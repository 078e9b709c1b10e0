defmodule Missions.StatesTest do
  @moduledoc "Each state that a status can show is explained in the guide's table of states."
  use ExUnit.Case, async: true
  alias Missions.Landmark.Transitions
  alias Robot.Mission.Manual

  @guide Path.expand("../../../../docs/user-guide.md", __DIR__)
  @commands [
    {:move, 0.1, 0.0},
    {:goto, 1.0, 1.0, nil},
    {:follow, Hal.Pose.new(1, 1)},
    {:follow_the_leader, :mag1},
    {:find_blob, nil},
    :lead
  ]

  test "the guide explains them all" do
    [_before, table] = @guide |> File.read!() |> String.split("These are the states:\n\n")
    [table | _rest] = String.split(table, "\n\n", parts: 2)

    explained =
      for "| `" <> _ = row <- String.split(table, "\n"),
          [_all, state] <- Regex.scan(~r/`(\w+)`/, row |> String.split("|") |> Enum.at(1)),
          do: state

    states = Enum.uniq(Transitions.phases() ++ manual())
    assert Enum.map(states, &Atom.to_string/1) -- explained == []
  end

  # What it goes through with each command, and each way in which that ends.
  defp manual do
    {ready, mission, _effects} = Manual.init(:mag1, [])

    [ready, :idle] ++
      for command <- @commands,
          {during, going, _effects} = Manual.handle({:command, command}, mission),
          outcome <- [0, 1, 2],
          {after_it, _mission, _effects} =
            Manual.handle({:outcome, {:command, 1}, outcome}, going),
          phase <- [during, after_it],
          uniq: true,
          do: phase
  end
end
