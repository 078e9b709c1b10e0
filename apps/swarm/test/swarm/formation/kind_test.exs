defmodule Swarm.Formation.KindTest do
  # The formations of a build are settings of the application.
  use ExUnit.Case, async: false
  alias Hal.Pose
  alias Swarm.Formation

  defmodule Ladder do
    @moduledoc "Two columns side by side."
    @behaviour Swarm.Formation.Kind

    @impl Swarm.Formation.Kind
    def slot(rank, _robots), do: {-div(rank, 2) * 1.0, rem(rank, 2) * 1.0}
  end

  setup do
    Application.put_env(:swarm, :formations, ladder: Ladder, gone: Mine.NotInThisBuild)
    on_exit(fn -> Application.delete_env(:swarm, :formations) end)
  end

  test "a kind that the build adds works like the others" do
    assert List.last(Formation.kinds()) == :ladder
    assert {:ok, {:ladder, 1.5} = formation} = Formation.new(:ladder, spacing: 1.5)
    assert Formation.valid?(formation)
    assert Formation.slots(formation, 3) == [Pose.new(0, 1.5), Pose.new(-1.5, 0)]
    assert {:error, line} = Formation.new(:ladder, length: 3)
    assert line =~ "ladder" and line =~ "length"
  end

  test "a kind whose module is not in this build is not known, nor is any other" do
    refute :gone in Formation.kinds()
    refute Formation.valid?({:gone, 1.0})
    assert {:error, line} = Formation.new(:gone)
    assert line =~ ~r/formation: expected .*, got :gone/ and line =~ "ladder"
    refute Formation.valid?({"ladder", 1.0})
  end
end
