defmodule Lab.Trial.MarksTest do
  @moduledoc "Marks that hang in the world of a run, from the camera to what a robot perceives."
  use ExUnit.Case, async: true
  alias Lab.Trial
  alias Vision.Marks

  @why_not (case Marks.available() do
              :ok -> nil
              {:error, line} -> line
            end)

  @options %{
    robots: [:mag1, :mag2],
    landmark: :none,
    seed: 4,
    marks: [
      size: 0.3,
      at: [{3, {1.5, 0.0, 180}}, {3, {-1.5, 0.0, 0}}, {8, {0.0, 1.5, -90}}, {8, {0.0, -1.5, 90}}]
    ]
  }

  # What the robots' cameras show in a run of so many ticks.
  defp seen(options, ticks) do
    {:ok, setup} = Trial.setup(options)
    trial = Enum.reduce(1..ticks, Trial.begin(setup, record: true), fn _, t -> Trial.step(t) end)
    {entries, _trial} = Trial.take_entries(trial)
    for {:step, id, {:detections, seen}, _effects} <- entries, do: {id, seen}
  end

  @tag skip: @why_not
  test "robots see them with the picture, and none where they look for none" do
    all = seen(@options, 60)
    assert Enum.all?(all, fn {_id, seen} -> is_list(seen.marks) end)
    marks = for {_id, seen} <- all, mark <- seen.marks, do: mark
    assert Enum.uniq(for mark <- marks, do: mark.id) -- [3, 8] == []
    assert length(marks) > 30
    assert Enum.all?(marks, &(&1.range > 0.0 and &1.range_sd > 0.0 and &1.at_ms >= 0))

    none = seen(%{@options | marks: nil}, 5)
    assert none != [] and Enum.all?(none, fn {_id, seen} -> seen.marks == nil end)
  end

  for family <- [:tag36h11, :similar] do
    @tag skip: with({:error, line} <- Marks.available(family), do: line, else: (:ok -> nil))
    test "without painting, the same marks are read as well as in pictures: #{family}" do
      marks = [family: unquote(family), size: 1.0] ++ Keyword.delete(@options.marks, :size)
      as_well(Map.put(@options, :marks, marks))
    end
  end

  defp as_well(options) do
    read = fn blobs ->
      for {id, seen} <- seen(Map.put(options, :blobs, blobs), 60),
          mark <- seen.marks,
          mark.at_ms == seen.at_ms,
          into: %{},
          do: {{id, mark.at_ms, mark.id, mark.x > 160}, mark}
    end

    {direct, painted} = {read.(:direct), read.(:painted)}
    both = for {key, mark} <- direct, other = painted[key], do: {mark, other}
    assert length(both) > 0.8 * map_size(painted)
    assert length(both) > 0.5 * map_size(direct)

    for {a, b} <- both do
      assert_in_delta a.range, b.range, 5 * (a.range_sd + b.range_sd)
      assert_in_delta a.bearing, b.bearing, 5 * (a.bearing_sd + b.bearing_sd)
      if a.yaw && b.yaw, do: assert_in_delta(a.yaw, b.yaw, 5 * (a.yaw_sd + b.yaw_sd))
    end
  end

  @tag skip: @why_not
  test "a mark on a robot's back is read from behind, in pictures and without painting" do
    marks = [size: 0.2, robots: [{11, :mag1}, {12, :mag2}], height: 0.3]

    for blobs <- [:direct, :painted] do
      {:ok, setup} = Trial.setup(%{@options | marks: marks} |> Map.put(:blobs, blobs))
      [one, two] = setup.world.order
      # The second one stands a metre behind the first, and looks at it.
      %{pose: pose} = setup.world.robots[one]

      ahead = fn heading ->
        back = Hal.Pose.compose(pose, Hal.Pose.new(-1.2, 0.0, 0.0))
        world = Sim.World.displace(setup.world, two, back)
        %{setup | world: Sim.World.displace(world, one, %{pose | heading: heading})}
      end

      read = fn setup ->
        trial = Trial.begin(setup)
        {detections, _trial} = Lab.Trial.Mechanics.look(trial, two)
        for mark <- detections.marks, do: {mark.id, Float.round(mark.range, 1)}
      end

      assert [{11, range}] = read.(ahead.(pose.heading))
      assert_in_delta range, 1.2 - setup.world.robots[one].profile.radius, 0.11
      assert read.(ahead.(pose.heading + :math.pi())) == []
    end
  end

  @tag skip: @why_not
  test "robots correct their poses by marks that they know, and not for ever by one that hangs elsewhere" do
    at = [{1, {3.0, 0.0, 180}}, {2, {-3.0, 0.0, 0}}, {3, {0.0, 3.0, -90}}, {4, {0.0, -3.0, 90}}]
    told = List.keyreplace(at, 3, 0, {3, {0.0, 5.0, -90}})

    off = fn known, seconds ->
      options = %{robots: [:mag1, :mag2, :min1], noise: :slip, map: "hall", blobs: :direct}
      options = Map.merge(options, %{landmark: :none, seed: 3, mission: {:patrol, side: 3}})
      marks = [size: 0.4, at: at, known: known]
      {:ok, setup} = Trial.setup(Map.put(options, :marks, marks))
      trial = setup |> Trial.begin() |> Trial.command(:mag1, :start)

      {offs, _trial} =
        Enum.map_reduce(1..(seconds * 10), trial, fn _, trial ->
          trial = Trial.step(trial)

          offs =
            for {id, claim} <- Lab.Trial.Mechanics.claims(trial),
                do: Hal.Pose.distance(claim.believed, Sim.World.truth(trial.world, id))

          {Enum.sum(offs) / length(offs), trial}
        end)

      offs |> Enum.take(-600) |> Enum.sum() |> Kernel./(600)
    end

    without = off.([], 120)
    assert without > 0.2
    assert off.(:all, 120) < min(0.15, without / 2)
    assert off.(told, 120) < without
  end

  test "what cannot hang, or cannot be seen, is one line" do
    error = fn options ->
      with {:ok, _} <- Trial.setup(Map.merge(@options, options)), do: :none
    end

    assert {:error, line} = error.(%{marks: [size: 1, at: [{:three, {0, 0, 0}}]]})
    assert line =~ "marks.at"

    unless @why_not,
      do:
        assert(
          error.(%{marks: [size: 1, robots: [{3, :mag9}]]}) ==
            {:error, "marks.robots: :mag9 is no robot of this run"}
        )

    if @why_not,
      do: assert({:error, @why_not} == error.(%{})),
      else:
        assert(
          {:error, "tag36h11 has no mark 587"} ==
            error.(%{marks: [size: 1, at: [{587, {0, 0, 0}}]]})
        )
  end
end
