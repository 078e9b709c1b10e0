defmodule Lab.ReplacementTest do
  @moduledoc "A live fleet is given other missions while it drives."
  use ExUnit.Case, async: false
  import Swarm.Case, only: [eventually: 1, order: 1]
  alias Hal.Event
  alias Robot.Board
  alias Lab.Fleet
  @moduletag :realtime
  @moduletag :capture_log

  @ids [:mag61, :mag62, :min61]

  @doc false
  def stage(_event, _measured, %{stage: :replacement, robot: id, what: what} = about, test),
    do: send(test, {what, id, speed(id), about.says})

  def stage(_event, _measured, _about, _test), do: :ok

  # What its wheels reported last, m/s.
  defp speed(id) do
    {:ok, %{twist: twist}, _at_ms} = Board.fetch(Board.find!(id), :odometry, :infinity)
    abs(twist.linear)
  end

  defp told(what, ids \\ @ids) do
    for id <- ids do
      assert_receive {^what, ^id, speed, says}, 30_000
      {speed, says}
    end
  end

  defp drive?, do: Enum.any?(@ids, &(speed(&1) > 0.1))

  setup do
    handler = {__MODULE__, self()}
    :ok = Event.attach(handler, [:robot, :stage], &__MODULE__.stage/4, self())

    options = [
      robots: @ids,
      landmark: :none,
      map: "hall",
      seed: 3,
      mission: {:patrol, period: 60}
    ]

    {:ok, fleet} = Fleet.start_link(options)

    on_exit(fn ->
      Event.detach(handler)
      monitor = Process.monitor(fleet)
      assert_receive {:DOWN, ^monitor, _, _, _}, 5_000
    end)

    eventually(&drive?/0)
    %{fleet: fleet}
  end

  test "all stand, change, and go on with another mission of the release", %{fleet: fleet} do
    assert order(fn -> Swarm.replace(:all, {:flock, spacing: 1.2}) end) == :ok
    assert Enum.any?(told(:changing), fn {speed, _says} -> speed > 0.05 end)
    for {speed, _says} <- told(:replaced), do: assert(speed <= 0.02)

    for id <- @ids,
        do: eventually(fn -> Swarm.status(id).state in [:gather, :flock, :arrived] end)

    eventually(&drive?/0)

    assert Enum.map(told(:kept), &elem(&1, 1)) |> Enum.uniq() == [
             "keeps flock, given by #{node()}"
           ]

    # People see it among the stages of the run.
    assert %{stages: stages} = Fleet.scene(fleet)
    assert Enum.any?(stages, &(&1.stage == :replacement))
    assert Fleet.result(fleet).collisions == 0
    Fleet.stop(fleet)
  end

  test "who orders another mission as soon as the fleet is there is not overtaken by its first start",
       %{fleet: fleet} do
    Fleet.stop(fleet)
    {:ok, fleet} = Fleet.start_link(robots: @ids, landmark: :none, mission: :patrol)
    assert order(fn -> Swarm.replace(:all, :flock) end) == :ok
    told(:replaced)

    for id <- @ids,
        do: eventually(fn -> Swarm.status(id).state in [:gather, :flock, :arrived] end)

    told(:kept)
    for id <- @ids, do: assert(Swarm.status(id).state in [:gather, :flock, :arrived])
    Fleet.stop(fleet)
  end
end
