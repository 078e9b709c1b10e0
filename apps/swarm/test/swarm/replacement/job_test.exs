defmodule Swarm.Replacement.JobTest do
  use ExUnit.Case, async: true
  alias Swarm.Replacement.Job

  @new {Ours.New, []}
  @was {Ours.Old, at: 1}

  defp new(robots), do: Job.new(robots, @new, 0)

  # Events with their times; the effects of all of them.
  defp run(job, events) do
    Enum.reduce(events, {job, []}, fn {event, now_ms}, {job, effects} ->
      {job, more} = Job.step(job, event, now_ms)
      {job, effects ++ more}
    end)
  end

  # Up to where robots have started the new mission, at 400 ms.
  defp started(robots) do
    {job, _effects} = new(robots)
    stood = for {id, was} when was != nil <- Enum.sort(robots), do: {{:stood, id}, 100}
    up = [{{:tick, []}, 200}, {{:tried, {:ok, [radius: 2]}}, 400}]
    {%{phase: :watching} = job, effects} = run(job, stood ++ up)
    {job, effects}
  end

  test "robots stand, change, go on, and keep it after ten seconds" do
    {job, effects} = new(%{mag1: @was, mag2: @was, min1: nil})
    # Who is on no mission is left alone.
    assert effects == [{:note, :changing, nil}, {:stand, :mag1}, {:stand, :mag2}]

    {job, []} = run(job, [{{:stood, :mag1}, 50}, {{:tick, []}, 100}])
    assert {job, [:try]} = run(job, [{{:stood, :mag2}, 150}, {{:tick, []}, 200}])
    {job, effects} = run(job, [{{:tried, {:ok, [radius: 2]}}, 250}])
    mission = {Ours.New, [radius: 2]}

    assert effects == [
             {:note, :replaced, nil},
             {:start, :mag1, mission},
             {:start, :mag2, mission}
           ]

    assert {job, []} = run(job, [{{:started, :mag1, :ok}, 260}, {{:tick, []}, 10_249}])
    assert {%{phase: :done}, [{:note, :kept, nil}]} = run(job, [{{:tick, []}, 10_250}])
  end

  test "a robot has to come to rest first, and is asked again if its pilot was just away" do
    {job, _effects} = new(%{mag1: @was})
    assert {job, []} = run(job, [{{:stood, :mag1}, 50}, {{:tick, [:mag1]}, 600}])
    assert {_job, [:try]} = run(job, [{{:tick, [:mag2]}, 700}])

    {job, _effects} = new(%{mag1: @was})
    assert {job, []} = run(job, [{{:tick, []}, 499}])
    assert {job, [{:stand, :mag1}]} = run(job, [{{:tick, []}, 500}, {{:tick, []}, 550}])
    # In vain: it goes on as before.
    back = [{:note, :back, "mag1 does not stand"}, {:start, :mag1, @was}]
    assert {%{phase: :done}, ^back} = run(job, [{{:tick, []}, 3_000}])
  end

  test "no robot is on a mission: nobody is told to stand, nor to start" do
    {job, effects} = new(%{mag1: nil})
    assert effects == [{:note, :changing, nil}, :try]

    {job, effects} = run(job, [{{:tried, {:ok, []}}, 20}])
    assert effects == [{:note, :replaced, nil}]

    # Its first ten seconds begin with its first start.
    assert {job, []} = run(job, [{{:tick, []}, 60_000}])
    assert {job, [{:watch, :mag1}]} = run(job, [{{:runs, :mag1}, 70_000}])

    assert {%{phase: :done}, [{:note, :kept, nil}]} =
             run(job, [{{:tick, []}, 79_999}, {{:tick, []}, 80_000}])

    # Nobody starts what went back, because nothing ran before.
    assert {%{phase: :done}, effects} = run(job, [{{:crashed, :mag1, "boom"}, 72_000}])
    why = "it ended on mag1 after 2.0 s (boom)"
    assert effects == [{:note, :changing, nil}, {:note, :back, why}]
  end

  test "a version that ends within ten seconds takes all robots of the node back" do
    {job, _effects} = started(%{mag1: @was, mag2: {Ours.Old, at: 2}, min1: nil})
    {job, effects} = run(job, [{{:crashed, :mag2, "boom"}, 2_700}])
    assert effects == [{:note, :changing, nil}, {:stand, :mag1}, {:stand, :mag2}]

    # The pilot that crashed has not heard of it; it is asked again.
    assert {job, [{:stand, :mag2}]} = run(job, [{{:stood, :mag1}, 2_750}, {{:tick, []}, 3_200}])

    assert {%{phase: :done}, effects} = run(job, [{{:stood, :mag2}, 3_250}, {{:tick, []}, 3_300}])

    assert effects == [
             {:note, :back, "it ended on mag2 after 2.3 s (boom)"},
             {:start, :mag1, @was},
             {:start, :mag2, {Ours.Old, at: 2}}
           ]
  end

  test "a crash after ten seconds is that of any mission" do
    {job, _effects} = started(%{mag1: @was})
    {job, _effects} = run(job, [{{:tick, []}, 10_400}])
    assert {^job, []} = run(job, [{{:crashed, :mag1, "boom"}, 10_401}])
  end

  test "one that cannot stand does not keep the others from going back" do
    {job, _effects} = started(%{mag1: @was, mag2: @was})
    {job, _effects} = run(job, [{{:crashed, :mag1, "boom"}, 1_000}, {{:stood, :mag2}, 1_050}])
    assert {%{phase: :done}, [{:note, :back, _why} | _more]} = run(job, [{{:tick, []}, 4_000}])
  end

  test "options that it does not take, an init that hangs: it goes on as before" do
    {job, _effects} = new(%{mag1: @was})
    {job, [:try]} = run(job, [{{:stood, :mag1}, 50}, {{:tick, []}, 100}])
    go_on = &[{:note, :back, &1}, {:start, :mag1, @was}]

    assert {%{phase: :done}, effects} = run(job, [{{:tried, {:error, "radius"}}, 200}])
    assert effects == go_on.("radius")

    assert {job, []} = run(job, [{{:tick, []}, 2_099}])
    assert {%{phase: :done}, effects} = run(job, [{{:tick, []}, 2_100}])
    assert effects == go_on.("its init does not return")
  end

  test "whom a person stops meanwhile stands, and it stays; who cannot start it takes all back" do
    {job, _effects} = started(%{mag1: @was, mag2: @was})
    {job, []} = run(job, [{{:started, :mag1, {:error, :stopped}}, 500}])

    assert {_job, [{:note, :changing, nil}, {:stand, :mag2}]} =
             run(job, [{{:crashed, :mag2, "boom"}, 600}])

    assert {_job, [_note | _stand]} = run(job, [{{:started, :mag2, {:error, :no_mission}}, 600}])
  end

  test "a robot that ends is left out; if all have, it is over" do
    {job, _effects} = new(%{mag1: @was, mag2: @was})
    {job, []} = run(job, [{{:gone, :mag1}, 10}, {{:stood, :mag2}, 20}, {{:stood, :mag1}, 20}])
    assert {_job, [:try]} = run(job, [{{:tick, []}, 30}])
    assert {%{phase: :done}, []} = run(job, [{{:gone, :mag2}, 30}])

    {job, _effects} = started(%{mag1: @was, mag2: @was})
    # Its pilot, too, has ended with it.
    assert {job, []} = run(job, [{{:gone, :mag2}, 500}, {{:crashed, :mag2, "boom"}, 510}])
    assert {%{phase: :done}, []} = run(job, [{{:gone, :mag1}, 500}])
  end

  test "whatever comes in whatever order, it ends, and who was on a mission is started once more, last with what counts" do
    events = [
      {:stood, :mag1},
      {:stood, :mag2},
      {:tried, {:ok, []}},
      {:tried, {:error, "no"}},
      {:started, :mag1, :ok},
      {:started, :mag2, {:error, :late}},
      {:crashed, :mag1, "boom"},
      {:tick, []},
      {:tick, [:mag2]}
    ]

    for _ <- 1..2_000 do
      {job, first} = new(%{mag1: @was, mag2: @was})

      {job, effects} =
        Enum.reduce(1..400, {job, first}, fn n, {job, effects} ->
          {job, more} = Job.step(job, Enum.random(events), n * 100)
          {job, effects ++ more}
        end)

      # What the server would answer itself never fails to come.
      {job, more} = run(job, for(n <- 1..4, do: {{:tick, []}, 100_000 * n}))

      effects = effects ++ more
      assert job.phase == :done
      notes = for {:note, what, _why} <- effects, what != :changing, do: what
      last = for {:start, :mag1, mission} <- effects, do: mission

      case List.last(notes) do
        :kept -> assert List.last(last) == {Ours.New, []}
        :back -> assert List.last(last) == @was
      end
    end
  end
end
