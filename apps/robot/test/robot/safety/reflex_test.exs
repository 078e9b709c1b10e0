defmodule Robot.Safety.ReflexTest do
  use ExUnit.Case, async: true
  alias Hal.{Profile, Twist}
  alias Robot.{Body, Wish}
  alias Robot.Behaviour.Arbiter
  alias Robot.Safety.Reflex

  defp gate(profile \\ Profile.magellan()),
    do: profile |> Reflex.new() |> Reflex.sense({:sonar, Body.silence(profile)}, 0) |> elem(0)

  # Wishes and steps each 50 ms; gives the last twist, its limits and the gate.
  defp run(reflex, twist, from_ms, steps) do
    Enum.reduce(0..(steps - 1), {nil, [], reflex}, fn k, {_, _, reflex} ->
      at_ms = from_ms + 50 * k

      reflex
      |> Reflex.sense({:sonar, Body.silence(reflex.profile)}, at_ms)
      |> elem(0)
      |> Reflex.wish(twist, at_ms)
      |> Reflex.step(at_ms)
    end)
  end

  test "stands until somebody wishes, and again 200 ms after the last wish" do
    assert {twist, [:dead_man], _} = Reflex.step(gate(), 0)
    assert Twist.zero?(twist)
    {twist, _, reflex} = run(gate(), Twist.new(0.3, 0), 0, 20)
    assert twist.linear == 0.3
    assert {%Twist{linear: 0.3}, _, reflex} = Reflex.step(reflex, 1150)
    assert {twist, [:dead_man], _} = Reflex.step(reflex, 1151)
    assert Twist.zero?(twist)
  end

  test "where it moves only in the presence of a person, it does so for as long after the last word" do
    alone = Reflex.new(Profile.magellan(), presence: 1.0)
    assert {twist, [:absent], _} = run(alone, Twist.new(0.3, 0), 0, 1)
    assert Twist.zero?(twist)
    # To stand is always allowed.
    assert {_zero, [], _} = run(alone, Twist.zero(), 0, 1)

    {twist, _, reflex} = run(Reflex.present(alone, 0), Twist.new(0.3, 0), 0, 20)
    assert twist.linear == 0.3
    # A word that arrives out of turn takes nothing back.
    reflex = Reflex.present(reflex, -500)
    assert {%Twist{linear: 0.3}, [], reflex} = run(reflex, Twist.new(0.3, 0), 1_000, 1)
    assert {twist, [:absent], _} = run(reflex, Twist.new(0.3, 0), 1_001, 1)
    assert Twist.zero?(twist)
  end

  test "speeds up no faster than the profile allows" do
    {a, limits, reflex} = run(gate(), Twist.new(0.5, 1.0), 0, 1)
    assert a == Twist.new(0.025, 0.05)
    assert :acceleration in limits
    {b, [], _} = run(reflex, Twist.new(0.5, 1.0), 50, 20)
    assert b == Twist.new(0.5, 1.0)
  end

  test "an emergency stop is latched; after a reset a new wish is needed" do
    {_, _, reflex} = run(gate(), Twist.new(0.5, 0), 0, 20)
    stopped = Reflex.estop(reflex)
    assert {twist, [:estop], stopped} = Reflex.step(stopped, 1000)
    assert Twist.zero?(twist)
    {twist, [:estop], stopped} = run(stopped, Twist.new(0.5, 0), 1050, 5)
    assert Twist.zero?(twist)
    released = Reflex.reset(stopped)
    assert {_, [:dead_man], released} = Reflex.step(released, 1300)
    assert {%Twist{linear: v}, _, _} = run(released, Twist.new(0.5, 0), 1350, 1)
    assert v > 0
    assert Reflex.new(Profile.magellan(), latched?: true).latched?
  end

  test "when whoever wished is no more, it stands at once, not by a ramp" do
    {_, _, reflex} = run(gate(), Twist.new(0.5, 1.0), 0, 30)

    assert {twist, [:dead_man], reflex} =
             reflex |> Reflex.forget() |> elem(0) |> Reflex.step(1_500)

    assert Twist.zero?(twist)
    assert {%Twist{linear: v}, _, _} = run(reflex, Twist.new(0.5, 0.0), 1_550, 1)
    assert v > 0
  end

  test "a drive that is not armed stands at once, and begins again from standing" do
    {_, _, reflex} = run(gate(), Twist.new(0.5, 1.0), 0, 30)

    for state <- [:disarmed, {:error, :unplugged}] do
      {stopped, _urgency} = Reflex.sense(reflex, {:arming, %{state: state, why: nil}}, 1_500)
      assert {twist, [:disarmed], stopped} = run(stopped, Twist.new(0.5, 1.0), 1_500, 10)
      assert Twist.zero?(twist)
      {armed, _urgency} = Reflex.sense(stopped, {:arming, %{state: :armed, why: nil}}, 2_000)
      assert {first, [:acceleration | _], _} = run(armed, Twist.new(0.5, 1.0), 2_000, 1)
      assert first == Twist.new(0.025, 0.05)
      # The latch is stronger, and told first.
      assert {_, [:estop], _} = Reflex.step(Reflex.estop(stopped), 2_000)
    end

    fresh = Reflex.new(Profile.magellan(), armed?: false)
    assert {_, [:disarmed], _} = run(fresh, Twist.new(0.5, 0.0), 0, 3)
  end

  test "a touched side stops driving toward it, not away and not turning" do
    for {segment, stops} <- [
          {0, :ahead},
          {1, :ahead},
          {15, :ahead},
          {8, :back},
          {7, :back},
          {4, :none}
        ] do
      {_, _, reflex} = run(gate(), Twist.new(0.3, 0.2), 0, 20)
      {touched, _urgency} = Reflex.sense(reflex, {:bumpers, [segment]}, 1000)
      {ahead, limits, _} = run(touched, Twist.new(0.3, 0.2), 1000, 1)
      assert ahead.linear == if(stops == :ahead, do: 0.0, else: 0.3)
      assert :bumper in limits == (stops == :ahead)
      assert ahead.turn == 0.2
      {back, _, _} = run(touched, Twist.new(-0.3, 0), 1000, 30)
      assert back.linear == if(stops == :back, do: 0.0, else: -0.3)
    end
  end

  test "while it moves, a touch, what a sonar sees, arming and a wish that is gone do not wait" do
    {_, _, moving} = run(gate(), Twist.new(0.3, 0.2), 0, 20)
    near = List.duplicate(0.1, 16)

    for {reading, urgency} <- [
          {{:bumpers, [0]}, :now},
          {{:bumpers, []}, :later},
          {{:sonar, near}, :now},
          {{:arming, %{state: :disarmed, why: nil}}, :now},
          {{:power, 24.0}, :later}
        ] do
      assert {_, ^urgency} = Reflex.sense(moving, reading, 1_010)
      assert {_, :later} = Reflex.sense(gate(), reading, 1_010)
    end

    assert {_, :now} = Reflex.forget(moving)
    assert {_, :later} = Reflex.forget(gate())
  end

  test "of several steps at one time the last counts, but a stop holds" do
    {_, _, reflex} = run(gate(), Twist.new(0.3, 0.0), 0, 4)
    {_, _, once} = reflex |> Reflex.wish(Twist.new(0.0, 0.5), 200) |> Reflex.step(200)

    twice =
      Reflex.step(Reflex.wish(elem(Reflex.step(reflex, 200), 2), once.wish |> twist(), 200), 200)

    assert elem(twice, 0) == once.twist

    {touched, :now} = Reflex.sense(reflex, {:bumpers, [0]}, 200)
    {%Twist{linear: still}, _, touched} = Reflex.step(touched, 200)
    {let_go, _} = Reflex.sense(touched, {:bumpers, []}, 200)
    assert {%Twist{linear: ^still}, _, let_go} = Reflex.step(let_go, 200)
    assert still == 0.0
    assert {%Twist{linear: 0.025}, _, _} = Reflex.step(let_go, 250)
  end

  defp twist({linear, turn}), do: Twist.new(linear, turn)

  test "stops before what the sonars see in the direction of motion, and turns freely there" do
    for profile <- [Profile.magellan(), Profile.atrv_mini()] do
      ahead = Enum.find_index(profile.sonars, &(abs(&1.heading) < 0.01))
      # Drives at a wall from 3 m: it stands before it, and with room left.
      {gap, _} =
        Enum.reduce(0..600, {3.0, gate(profile)}, fn k, {gap, reflex} ->
          from_sonar = gap + profile.radius - Enum.at(profile.sonars, ahead).x
          sonar = List.replace_at(Body.silence(profile), ahead, from_sonar)
          {reflex, _urgency} = Reflex.sense(reflex, {:sonar, sonar}, 50 * k)
          reflex = Reflex.wish(reflex, Twist.new(0.5, 0.3), 50 * k)
          {twist, _, reflex} = Reflex.step(reflex, 50 * k)
          assert k < 10 or twist.turn == 0.3
          assert gap > 0.125
          {gap - 0.05 * twist.linear, reflex}
        end)

      assert gap < 0.18

      sonar = List.replace_at(Body.silence(profile), ahead, 0.1)
      reflex = profile |> Reflex.new() |> Reflex.sense({:sonar, sonar}, 0) |> elem(0)
      {twist, _, _} = reflex |> Reflex.wish(Twist.new(-0.3, 0), 0) |> Reflex.step(0)
      assert twist.linear < 0
      {twist, limits, _} = reflex |> Reflex.wish(Twist.new(0.3, 0), 0) |> Reflex.step(0)
      assert {twist.linear, :near in limits} == {0.0, true}
    end
  end

  test "passes slowly what is close beside its way, and freely what is behind or farther off" do
    profile = Profile.magellan()
    left = Enum.find_index(profile.sonars, &(abs(&1.heading - :math.pi() / 4) < 0.01))

    speed = fn range, wish ->
      sonar = List.replace_at(Body.silence(profile), left, range)

      {twist, limits, _reflex} =
        Enum.reduce(0..20, {nil, [], Reflex.new(profile)}, fn k, {_, _, reflex} ->
          {reflex, _urgency} = Reflex.sense(reflex, {:sonar, sonar}, 50 * k)
          reflex |> Reflex.wish(Twist.new(wish, 0.0), 50 * k) |> Reflex.step(50 * k)
        end)

      {twist.linear, :beside in limits}
    end

    # 0.27 m and 0.39 m to the left of the way of a body of 0.2 m.
    assert {slow, true} = speed.(0.182, 0.5)
    assert_in_delta slow, 0.1 + 4.0 * (0.382 * :math.sqrt(0.5) - 0.23), 1.0e-6
    assert speed.(0.35, 0.5) == {0.5, false}
    assert speed.(0.182, -0.5) == {-0.5, false}
  end

  test "without fresh sonars it creeps; a robot that has none does not" do
    {twist, limits, _} =
      Enum.reduce(0..40, {nil, [], gate()}, fn k, {_, _, reflex} ->
        reflex |> Reflex.wish(Twist.new(0.5, 0), 50 * k) |> Reflex.step(50 * k)
      end)

    assert twist.linear == 0.1
    assert :blind in limits
    {twist, [], _} = run(Reflex.new(%{Profile.magellan() | sonars: []}), Twist.new(0.5, 0), 0, 30)
    assert twist.linear == 0.5
  end

  describe "with a lidar" do
    defp lidar, do: %{Profile.magellan() | sonars: [], scan: Profile.scan(), sonar_round_s: 0.1}

    # All of what 360 rays see is far away, but for these degrees.
    defp scan(near \\ %{}) do
      degree = :math.pi() / 180
      rays = for k <- 0..359, into: <<>>, do: Hal.Scan.pack(Map.get(near, k, 9.0))
      {:scan, %Hal.Scan{start: 0.0, step: degree, ranges: rays}}
    end

    defp seen(reflex, scan, at_ms), do: reflex |> Reflex.sense(scan, at_ms) |> elem(0)

    defp at_speed(reflex, scan, twist) do
      for k <- 0..40, reduce: {nil, [], reflex} do
        {_, _, reflex} ->
          reflex |> seen(scan, 50 * k) |> Reflex.wish(twist, 50 * k) |> Reflex.step(50 * k)
      end
    end

    test "it stops before what a single ray sees, and drives past what is beside or behind" do
      reflex = Reflex.new(lidar())
      assert {%{linear: 0.5}, [], _} = at_speed(reflex, scan(), Twist.new(0.5, 0))
      assert {%{linear: 0.5}, [], _} = at_speed(reflex, scan(%{180 => 0.3}), Twist.new(0.5, 0))
      assert {stands, [:near | _], _} = at_speed(reflex, scan(%{0 => 0.3}), Twist.new(0.5, 0))
      assert stands.linear == 0.0
      assert {slow, [:near | _], _} = at_speed(reflex, scan(%{0 => 0.5}), Twist.new(0.5, 0))
      assert slow.linear > 0.1 and slow.linear < 0.4
      # Nearer than it measures: it may touch.
      assert {%{linear: linear}, _, _} = at_speed(reflex, scan(%{0 => 0.1}), Twist.new(0.5, 0))
      assert linear == 0.0
    end

    test "while it moves, a scan does not wait" do
      {_, _, moving} = at_speed(Reflex.new(lidar()), scan(), Twist.new(0.5, 0))
      assert {_, :now} = Reflex.sense(moving, scan(), 2_050)
      assert {^moving, :later} = Reflex.sense(moving, {:scan, :odd}, 2_050)
      # One that its body does not have is nowhere.
      assert {reflex, _} = Reflex.sense(gate(), scan(%{0 => 0.3}), 0)
      assert reflex == gate()
    end

    test "before the first scan it stands, without fresh ones it creeps, and then stands" do
      wish = &(&1 |> Reflex.wish(Twist.new(0.5, 0.0), &2) |> Reflex.step(&2))
      assert {%{linear: unseeing}, [:blind | _], _} = wish.(Reflex.new(lidar()), 0)
      assert unseeing == 0.0

      {_, _, reflex} = at_speed(Reflex.new(lidar()), scan(), Twist.new(0.5, 0))
      assert {%{linear: 0.5}, [], reflex} = wish.(reflex, 2_500)
      {_, _, reflex} = Enum.reduce(2_501..3_500//50, {0, 0, reflex}, &wish.(elem(&2, 2), &1))
      assert {%{linear: 0.1}, [:blind], reflex} = wish.(reflex, 4_000)
      {_, _, reflex} = Enum.reduce(4_001..4_400//50, {0, 0, reflex}, &wish.(elem(&2, 2), &1))
      assert {%{linear: stands}, [:blind], _} = wish.(reflex, 4_450)
      assert stands == 0.0
    end

    test "a body with sonars, too, stops before what either sees, and misses either" do
      body = %{Profile.magellan() | scan: Profile.scan()}
      reflex = Reflex.new(body)
      both = fn sonar, scan -> reflex |> seen({:sonar, sonar}, 0) |> seen(scan, 0) end
      silent = Body.silence(body)
      ahead = List.replace_at(silent, 11, 0.1)
      wish = &(&1 |> Reflex.wish(Twist.new(0.5, 0.0), 0) |> Reflex.step(0))
      assert {%{linear: free}, [:acceleration], _} = wish.(both.(silent, scan()))
      assert free > 0.0
      assert {_, [:near], _} = wish.(both.(ahead, scan()))
      assert {_, [:near], _} = wish.(both.(silent, scan(%{0 => 0.3})))
      assert {_, [:blind | _], _} = wish.(seen(reflex, scan(), 0))
      assert {_, [:blind | _], _} = wish.(seen(reflex, {:sonar, silent}, 0))
    end
  end

  test "without fresh sonars a robot longer than wide turns so that its corners creep, too" do
    mini = Profile.atrv_mini()

    for {profile, most} <- [{mini, 0.1 / mini.radius}, {Profile.magellan(), 0.5}] do
      {reflex, _} = profile |> Reflex.new() |> Reflex.sense({:sonar, Body.silence(profile)}, 0)

      {twist, limits, _reflex} =
        Enum.reduce(12..72, {nil, [], reflex}, fn k, {_, _, reflex} ->
          reflex |> Reflex.wish(Twist.new(0, 0.5), 50 * k) |> Reflex.step(50 * k)
        end)

      assert_in_delta twist.turn, most, 1.0e-9
      assert :blind in limits == most < 0.5
    end
  end

  test "the arbiter never beats the gate" do
    numbers = [
      0.0,
      0.1,
      -0.4,
      3,
      1.0e308,
      -1.0e308,
      99.0,
      -50,
      :nan,
      nil,
      "1",
      {1, 2},
      Bitwise.bsl(1, 4000)
    ]

    for _ <- 1..300 do
      profile = Enum.random([Profile.magellan(), Profile.atrv_mini()])

      Enum.reduce(1..40, {Reflex.new(profile), 0}, fn _, {reflex, at_ms} ->
        at_ms = at_ms + Enum.random([10, 50, 50, 50, 130, 400])

        wishes =
          for by <- [:a, :b], do: %Wish{by: by, weight: :rand.uniform(), twist: drawn(numbers)}

        before = reflex.twist

        reflex =
          if :rand.uniform(3) > 1,
            do: Reflex.wish(reflex, Arbiter.choose(wishes, :a).twist, at_ms),
            else: reflex

        reflex =
          if :rand.uniform(9) == 1,
            do: Reflex.wish(reflex, Enum.random([nil, :go, %{}, 7]), at_ms),
            else: reflex

        reflex = reflex |> Reflex.sense(reading(profile), at_ms) |> elem(0)
        reflex = if :rand.uniform(30) == 1, do: Reflex.estop(reflex), else: reflex
        reflex = if :rand.uniform(20) == 1, do: Reflex.reset(reflex), else: reflex
        since = reflex.at_ms
        {twist, limits, reflex} = Reflex.step(reflex, at_ms)

        assert Enum.all?([twist.linear, twist.turn], &is_float/1)
        assert abs(twist.linear) <= profile.max_linear
        assert abs(twist.turn) <= profile.max_turn
        seconds = if since, do: min(at_ms - since, 200) / 1000, else: 0.05
        dv = profile.max_acceleration * seconds + 1.0e-9
        dw = profile.max_turn_acceleration * seconds + 1.0e-9

        # Speeding up is never faster than the profile; braking at most twice; a hard stop is a stop.
        assert abs(twist.linear) - abs(before.linear) <= dv
        assert abs(twist.turn) - abs(before.turn) <= dw
        assert twist.linear == 0.0 or abs(twist.linear - before.linear) <= 2 * dv
        if reflex.latched?, do: assert(Twist.zero?(twist) and limits == [:estop])
        {reflex, at_ms}
      end)
    end
  end

  defp drawn(numbers), do: %Twist{linear: Enum.random(numbers), turn: Enum.random(numbers)}

  defp reading(profile) do
    Enum.random([
      {:sonar, for(_ <- profile.sonars, do: 5.2 * :rand.uniform())},
      {:sonar, [:broken | Body.silence(profile)]},
      {:sonar, []},
      {:bumpers, [:rand.uniform(16) - 1]},
      {:bumpers, []},
      {:bumpers, [:x]},
      {:power, 24.0},
      :rubbish
    ])
  end
end
