defmodule Lab.Check.InvariantsTest do
  @moduledoc "Each invariant is violated by what a test constructs, and not by what is next to it."
  use Lab.LockstepCase, async: true
  alias Hal.{Pose, Profile, Twist}
  alias Lab.Chaos.Runner
  alias Lab.Check.{Invariants, Leaders, Limits, Slots, Stops, Violation}
  alias Lab.{Moment, Trial}
  alias Sim.World
  alias Lab.Trial.{Faults, RunLog}
  alias Swarm.EStop
  alias Missions.Landmark.Reference

  doctest Lab.Run
  doctest Lab.Check.Violation
  doctest Lab.Check.Leaders

  @three [:mag1, :mag2, :mag3]

  defp options(more \\ %{}) do
    Map.merge(%{robots: @three, loss: 0.0, policy: :available, of: nil, delay_ms: {5, 50}}, more)
  end

  defp lead(id, epoch), do: claim(id, :lead, id, epoch)
  defp follow(id, leader, epoch), do: claim(id, :follow, leader, epoch)
  defp agree(id, sight), do: claim(id, :agree, nil, 0, sight)

  defp claim(id, phase, leader, epoch, sight \\ nil),
    do: {id, %{phase: phase, leader: leader, epoch: epoch, sight: sight}}

  # A moment of which this is known.
  defp moment(known) do
    log = RunLog.new(Missions.Landmark)
    start = %{at_ms: 0, options: options(), world: nil, run_log: log, faults: %Faults{}}
    claims = known[:claims] || []

    doing = for {id, claim} <- claims, into: %{}, do: {id, {Missions.Landmark, claim[:phase]}}

    start |> Moment.start() |> Map.put(:doing, doing) |> struct!(known)
  end

  defp note(module, judge, at_ms, moment) do
    {:never, found, judge} = module.note({:never, :any}, %{moment | at_ms: at_ms}, judge)
    {found, judge}
  end

  # What a judge finds first in so many ticks of the same; `nil` if nothing.
  defp first(module, judge, ticks, known, from_ms \\ 0) do
    Enum.reduce_while(1..ticks, {nil, judge}, fn k, {nil, judge} ->
      case note(module, judge, from_ms + 100 * k, moment(known)) do
        {[], judge} -> {:cont, {nil, judge}}
        {[violation | _], judge} -> {:halt, {violation, judge}}
      end
    end)
  end

  describe "leaders" do
    test "two of one part for longer than the lease, once they know each other" do
      claims = [lead(:mag1, 1), lead(:mag2, 2), follow(:mag3, :mag1, 1)]
      judge = Leaders.new(options())
      assert {nil, _judge} = first(Leaders, judge, 37, claims: claims, parts: [@three])

      assert {%Violation{invariant: :two_leaders, at_ms: 4_000, robots: [:mag1, :mag2]}, _judge} =
               first(Leaders, judge, 100, claims: claims, parts: [@three])

      assert {nil, _judge} =
               first(Leaders, judge, 300, claims: claims, parts: [[:mag1, :mag3], [:mag2]])

      assert {%Violation{at_ms: 15_400}, _judge} =
               first(Leaders, Leaders.new(options(%{loss: 0.5})), 300,
                 claims: claims,
                 parts: [@three]
               )
    end

    test "two of one epoch at once, but not just after their parts have met" do
      claims = [lead(:mag1, 4), lead(:mag2, 4), follow(:mag3, :mag1, 4)]
      judge = Leaders.new(options())

      assert {%Violation{invariant: :two_leaders}, _judge} =
               first(Leaders, judge, 100, claims: claims, parts: [@three])

      calm = [lead(:mag1, 3), follow(:mag2, :mag1, 3), follow(:mag3, :mag1, 3)]
      {nil, judge} = first(Leaders, judge, 30, claims: calm, parts: [@three])

      assert {%Violation{invariant: :same_epoch, at_ms: 3_100, figures: "both lead in epoch 4"},
              _} = first(Leaders, judge, 1, [claims: claims, parts: [@three]], 3_000)
    end

    test "two majorities at any time, wherever they are" do
      judge = Leaders.new(options(%{policy: :majority}))
      claims = [lead(:mag1, 1), lead(:mag2, 2)]

      assert {%Violation{invariant: :two_majorities, at_ms: 100}, _judge} =
               first(Leaders, judge, 1, claims: claims, parts: [[:mag1], [:mag2]])
    end

    test "a robot that follows somebody else than its part does" do
      claims = [lead(:mag1, 2), follow(:mag2, :mag1, 2), follow(:mag3, :min9, 1)]
      judge = Leaders.new(options())
      assert {nil, _judge} = first(Leaders, judge, 100, claims: claims, parts: [@three])

      assert {%Violation{invariant: :not_together, at_ms: 10_200, figures: figures}, _judge} =
               first(Leaders, judge, 200, claims: claims, parts: [@three])

      assert figures =~ "mag3 follow of min9 in 1"
      # One whose mission was stopped is not asked.
      stopped = [lead(:mag1, 2), follow(:mag2, :mag1, 2), {:mag3, %{}}]
      assert {nil, _judge} = first(Leaders, judge, 200, claims: stopped, parts: [@three])
    end

    test "nobody leads, although somebody sees the landmark" do
      seen = [agree(:mag1, %{merit: 9}), agree(:mag2, nil), agree(:mag3, nil)]
      judge = Leaders.new(options())

      assert {%Violation{invariant: :no_leader, at_ms: 45_200}, _judge} =
               first(Leaders, judge, 600, claims: seen, parts: [@three])

      unseen = for id <- @three, do: agree(id, nil)
      assert {nil, _judge} = first(Leaders, judge, 600, claims: unseen, parts: [@three])
      # Too few, where a majority is needed; and alone.
      judge = Leaders.new(options(%{policy: :majority, of: 6}))
      assert {nil, _judge} = first(Leaders, judge, 600, claims: seen, parts: [@three])
      judge = Leaders.new(options())

      assert {nil, _judge} =
               first(Leaders, judge, 600, claims: seen, parts: [[:mag1], [:mag2], [:mag3]])
    end
  end

  describe "slots" do
    defp anchor(more) do
      struct!(
        %Reference{
          leader: :mag1,
          epoch: 1,
          sequence: 5,
          pose: {0, 0, 0},
          twist: {0, 0},
          formation: {:column, 1.0},
          order: [:mag2, :mag3],
          size: 3,
          places: [1, 2]
        },
        more
      )
    end

    defp follower(id, anchor, at_ms),
      do: {id, %{phase: :follow, me: id, anchor: anchor, anchor_ms: at_ms}}

    defp places(missions, at_ms) do
      for {id, mission} <- missions,
          place = Missions.Landmark.place(mission, at_ms),
          do: {id, place}
    end

    test "two followers that believe two orders for longer than an anchor is good" do
      other = anchor(order: [:mag3, :mag2], sequence: 6)

      tick = fn k -> [follower(:mag2, anchor([]), k), follower(:mag3, other, k)] end
      judge = Slots.new(options())

      {found, _judge} =
        Enum.flat_map_reduce(1..30, judge, fn k, judge ->
          places = places(tick.(100 * k), 100 * k)
          note(Slots, judge, 100 * k, moment(places: places))
        end)

      assert [%Violation{invariant: :same_slot, robots: [:mag2, :mag3], at_ms: 1_600} | _] = found

      # Each in an epoch of its own, or with an anchor that is too old.
      for {mine, at_ms} <- [{anchor(epoch: 2), 9_900}, {anchor([]), 8_000}] do
        missions = [follower(:mag2, mine, at_ms), follower(:mag3, other, 9_900)]
        known = moment(places: places(missions, 10_000))
        assert {[], %{same: same}} = note(Slots, judge, 10_000, known)
        assert same == %{}
      end
    end

    test "an anchor that gives one slot to two" do
      leader = {:mag1, %{phase: :lead, anchor: anchor(places: [1, 1])}}

      assert {[%Violation{invariant: :bad_anchor, robots: [:mag1]}], _judge} =
               note(Slots, Slots.new(options()), 100, moment(places: places([leader], 100)))

      right = {:mag1, %{phase: :lead, anchor: anchor([])}}
      known = moment(places: places([right], 100))
      assert {[], _judge} = note(Slots, Slots.new(options()), 100, known)
    end
  end

  describe "limits" do
    defp body(wanted, x \\ 0.0) do
      robot = %{id: :mag1, profile: Profile.magellan(), pose: Pose.new(x, 0)}
      %{World.Body.new(robot, 0, 1, :off) | wanted: wanted}
    end

    defp driven(bodies, held \\ [], lifted \\ []) do
      stop = %EStop.State{held: if(held == [], do: [], else: [7])}

      {found, _judge} =
        bodies
        |> Enum.with_index(1)
        |> Enum.flat_map_reduce(Limits.new(options()), fn {body, k}, judge ->
          known =
            moment(claims: [mag1: %{}], stops: %{mag1: stop}, world: %{robots: %{mag1: body}})

          stages = for id <- lifted, do: %{stage: :displaced, robot: id, at_s: k / 10}
          note(Limits, judge, 100 * k, put_in(known.run_log.stages, stages))
        end)

      Enum.map(found, & &1.invariant)
    end

    test "speeds of the profile, and no others" do
      assert driven([body(Twist.new(0.5, 1.0))]) == []
      assert driven([body(Twist.new(0.51, 0.0))]) == [:too_fast]
      assert driven([body(Twist.new(0.0, -1.01))]) == [:too_fast]
      assert driven([body(Twist.zero(), 0.0), body(Twist.zero(), 0.04)]) == []
      assert driven([body(Twist.zero(), 0.0), body(Twist.zero(), 0.06)]) == [:too_fast]
    end

    test "speeds grow and shrink by the ramp; a stop is at once" do
      from = fn a, b -> driven([body(Twist.new(a, 0.0)), body(Twist.new(b, 0.0))]) end
      assert from.(0.1, 0.15) == []
      assert from.(0.1, 0.16) == [:too_abrupt]
      assert from.(0.4, 0.3) == []
      assert from.(0.4, 0.2) == [:too_abrupt]
      assert from.(0.4, 0.0) == []
      assert from.(0.05, -0.05) == []
      assert from.(0.1, -0.1) == [:too_abrupt]
    end

    test "a robot that a stop holds wants to stand, and stands when it has braked" do
      assert driven([body(Twist.new(0.1, 0.0))], [:mag1]) == [:stop_ignored]
      assert driven([body(Twist.zero())], [:mag1]) == []
      crawling = for k <- 0..30, do: body(Twist.zero(), 0.01 * k)
      assert driven(crawling) == []
      assert :stop_ignored in driven(crawling, [:mag1])
      assert driven(crawling, [:mag1], [:mag1]) == []
    end
  end

  test "a stop that does not reach a robot of the part is lost; a cleared one need not" do
    held = %EStop.State{held: [7]}
    stops = %{mag1: held, mag2: %EStop.State{}}
    judge = Stops.new(options())

    assert {%Violation{invariant: :stop_lost, robots: [:mag2], at_ms: 2_200}, _judge} =
             first(Stops, judge, 100, stops: stops, parts: [[:mag1, :mag2]])

    assert {nil, _judge} = first(Stops, judge, 100, stops: stops, parts: [[:mag1], [:mag2]])
    cleared = %{stops | mag2: %EStop.State{cleared: [7]}}
    assert {nil, _judge} = first(Stops, judge, 100, stops: cleared, parts: [[:mag1, :mag2]])
  end

  describe "a whole run" do
    defp trial(options) do
      {:ok, trial} = Trial.new(Map.merge(%{robots: [:mag1], blobs: :direct}, options))
      trial
    end

    defp tick(judge, trial), do: Invariants.tick(judge, Moment.of(trial))
    defp names(judge), do: judge |> Invariants.violations() |> Enum.map(& &1.invariant)

    test "a contact of the world is a collision" do
      trial = trial(%{robots: [:mag1, :mag2]})
      judge = Invariants.new(trial.options)
      assert names(tick(judge, trial)) == []
      parties = [{:mag1, {0.0, 0.0}, 0.2}, {:mag2, {0.4, 0.0}, 0.0}]

      world = %{trial.world | collisions: 1, contacts: [{900, parties, :robots}]}
      judge = tick(judge, %{trial | world: world, at_ms: 1_000})

      assert [%Violation{invariant: :collision, at_ms: 900, robots: [:mag1, :mag2]} = one] =
               Invariants.violations(judge)

      assert one.figures == "mag1 at 0.00,0.00 with 0.20 m/s, mag2 at 0.40,0.00 with 0.00 m/s"
      # Told once.
      judge = tick(judge, %{trial | world: world, at_ms: 1_100})
      assert names(judge) == [:collision]
    end

    test "what the trial says of robots that are stuck, but for one that was frozen" do
      trial = trial(%{script: [{1, {:freeze, :mag1, 2}}]})
      silence = %{at_s: 10.0, robot: :mag1, error_m: 1.25}
      log = %{trial.run_log | stuck: %Lab.Trial.Progress{told: [silence]}}
      trial = %{trial | run_log: log, at_ms: 30_000}
      judge = tick(Invariants.new(trial.options), trial)
      assert [%Violation{invariant: :stuck, figures: figures}] = Invariants.violations(judge)
      assert figures == "1.25 m off since 10.0 s, and says nothing"

      faults = Lab.Trial.Faults.add(trial.faults, :frozen, :mag1, 12_000, 20_000)
      frozen = %{trial | faults: faults}
      assert names(tick(Invariants.new(trial.options), frozen)) == []
    end

    test "false claims are told at the end" do
      claim = %{at_s: 12.5, robot: :mag1, worst_m: 0.2, worst_5s_m: 0.7}
      judge = Invariants.new(trial(%{}).options)
      assert names(Invariants.finish(judge, %{claims: [%{claim | worst_5s_m: 0.4}]})) == []
      judge = Invariants.finish(judge, %{claims: [claim]})
      assert [%Violation{invariant: :false_claim, at_ms: 12_500}] = Invariants.violations(judge)
      assert %Violation{} = Invariants.first(judge, :false_claim)
    end

    test "a claim that is being withdrawn when it is judged again is judged by its beginning" do
      claim = %{at_s: 1.0, robot: :mag1, worst_m: 0.2, worst_5s_m: 0.7}
      trial = trial(%{})
      formed = %{phase: :lead, formed: true, leader: :mag1, epoch: 1, sight: nil}

      # Formed from 1.0 s on, for so many ticks.
      judged = fn ticks, claim ->
        judge =
          Enum.reduce(1..80, Invariants.new(trial.options), fn k, judge ->
            formed? = k > 10 and k <= 10 + ticks

            trial =
              put_in(trial.members[:mag1].lockstep.roles.pilot.runner.claim, %{
                formed
                | formed: formed?
              })

            tick(judge, %{trial | at_ms: 100 * k})
          end)

        names(Invariants.finish(judge, %{claims: [claim]}))
      end

      assert judged.(57, claim) == []
      assert judged.(58, claim) == [:false_claim]
      assert judged.(70, claim) == [:false_claim]
      assert judged.(57, %{claim | worst_m: 0.6}) == [:false_claim]
    end

    test "what a frozen robot claimed last does not count" do
      trial = trial(%{robots: [:mag1, :mag2], policy: :majority})
      claim = %{phase: :lead, leader: :mag1, epoch: 1, sight: nil}

      leading = fn trial, id ->
        put_in(trial.members[id].lockstep.roles.pilot.runner.claim, %{claim | leader: id})
      end

      trial = %{(trial |> leading.(:mag1) |> leading.(:mag2)) | at_ms: 1_000}
      assert names(tick(Invariants.new(trial.options), trial)) == [:two_majorities]
      frozen = %{trial | faults: Lab.Trial.Faults.add(trial.faults, :frozen, :mag1, 0, 2_000)}
      assert names(tick(Invariants.new(trial.options), frozen)) == []
    end

    test "an invariant that is violated ends a run; one that is not gives nothing" do
      run = [robots: [:mag1, :mag2], blobs: :direct, seed: 2, duration_s: 20]
      assert Runner.first(run, :collision) == nil
      assert Runner.first([robots: 12], :collision) == nil
      assert {:ok, %{violations: [], simulated_s: 20.0, robots: 2}} = Runner.judge(run)
      assert {:error, "trial option robots" <> _} = Runner.judge(robots: 12)
    end
  end
end
