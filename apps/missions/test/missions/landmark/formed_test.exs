defmodule Missions.Landmark.FormedTest do
  @moduledoc "When people are told that the shape is formed."
  use ExUnit.Case, async: true
  alias Missions.Landmark.Group

  defp formed do
    group =
      Group.new()
      |> Group.join(:mag1, {0, 0}, 0.02)
      |> Group.join(:mag2, {-1, 0}, nil)
      |> Group.join(:mag3, {-2, 0}, nil)

    {true, group} = Group.until(group, 40, &formed?/1)
    assert told(group) == 1
    group
  end

  defp formed?(group), do: group.robots.mag1.claim[:formed] == true
  defp told(group), do: Enum.count(group.stages, &match?({:formed, _robot, _ms}, &1))
  defp moved(group, id, metres), do: update_in(group.robots[id].pose.x, &(&1 + metres))

  # Out of its place, and back by itself.
  defp leaves(group, id) do
    {true, group} = group |> moved(id, -1.0) |> Group.until(5, &(not formed?(&1)))
    group
  end

  defp again(group) do
    {true, group} = Group.until(group, 40, &formed?/1)
    group
  end

  test "one that leaves its place and comes back, again and again, is no news, though the claim follows it" do
    group = Enum.reduce(1..10, formed(), fn _, group -> group |> leaves(:mag3) |> again() end)
    assert told(group) == 1
  end

  test "news are a leader elsewhere, a shape that people asked for, one robot less, and a long time" do
    group = formed() |> moved(:mag1, 1.0) |> Group.run(1) |> again()
    assert told(group) == 2

    command = {:command, {:formation, :column, 1.2}}
    asked = Enum.reduce([:mag1, :mag2, :mag3], group, &Group.event(&2, &1, command))
    assert asked |> Group.run(1) |> again() |> told() == 3

    assert group |> Group.kill(:mag3) |> leaves(:mag2) |> Group.run(3) |> again() |> told() == 3

    away = Enum.reduce(1..210, leaves(group, :mag3), fn _, g -> g |> held() |> Group.run(0.1) end)
    assert away |> again() |> told() == 3
  end

  defp held(group), do: put_in(group.robots.mag3.pose.x, -4.0)
end
