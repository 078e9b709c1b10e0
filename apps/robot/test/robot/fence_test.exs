defmodule Robot.Safety.FenceTest do
  use ExUnit.Case, async: true
  alias Hal.{Odometry, Pose, Profile, Twist}
  alias Robot.Body
  alias Robot.Safety.Reflex
  alias Robot.Fence
  @moduletag :slow
  doctest Robot.Fence

  @step_s 0.05

  defp fence(corners) do
    {:ok, fence} = Fence.new(corners)
    fence
  end

  # A room with a corner that reaches into it.
  defp nook,
    do: fence([{-3, -2}, {3, -2}, {3, 2}, {0.5, 2}, {0.5, 0.5}, {-0.5, 0.5}, {-0.5, 2}, {-3, 2}])

  defp gate(fence, profile, start \\ Pose.new(0, 0)),
    do: Reflex.new(profile, fence: fence, start: start)

  # A base obeys late, and neither gathers speed nor brakes faster than its body can.
  defp wheels(now, wanted, profile),
    do:
      Twist.new(
        slew(now.linear, wanted.linear, profile.max_acceleration),
        slew(now.turn, wanted.turn, profile.max_turn_acceleration)
      )

  defp slew(now, wanted, most),
    do: wanted |> max(now - most * @step_s) |> min(now + most * @step_s)

  # Odometry comes each 100 ms, wishes too; gives the poses of the way, first to last.
  defp run(fence, profile, pose, seconds, wish) do
    start = %{pose: pose, twist: Twist.zero(), sent: Twist.zero(), gate: gate(fence, profile)}

    {way, _body} =
      Enum.map_reduce(0..round(seconds / @step_s), start, fn k, body ->
        at_ms = 50 * k
        {gate, _urgency} = Reflex.sense(body.gate, {:sonar, Body.silence(profile)}, at_ms)

        gate =
          if rem(k, 2) == 0 do
            odometry = %Odometry{pose: body.pose, twist: body.twist}

            gate
            |> Reflex.sense({:odometry, odometry}, at_ms)
            |> elem(0)
            |> Reflex.wish(wish.(body, k), at_ms)
          else
            gate
          end

        {twist, limits, gate} = Reflex.step(gate, at_ms)
        # One step of delay on the wire.
        rolls = wheels(body.twist, body.sent, profile)
        pose = Body.move(body.pose, rolls, @step_s)
        body = %{body | pose: pose, twist: rolls, sent: twist, gate: gate}
        {{pose, rolls, limits}, body}
      end)

    way
  end

  defp least(way, fence),
    do:
      way
      |> Enum.map(fn {pose, _, _} -> Fence.clearance(fence, Pose.point(pose)) end)
      |> Enum.min()

  test "drives up to the line, slows down, and stands before it; away from it is free" do
    profile = Profile.magellan()
    room = fence({{-1, -1}, {3, 1}})
    way = run(room, profile, Pose.new(0, 0), 15, fn _, _ -> Twist.new(0.5, 0.0) end)
    speeds = for {_, rolls, _} <- way, do: rolls.linear
    assert Enum.max(speeds) > 0.49
    {last, rolls, limits} = List.last(way)
    assert abs(rolls.linear) < 0.01 and :fence in limits
    # The body's edge is 0 to 10 cm before the line.
    assert last.x + profile.radius <= 3.0 and last.x + profile.radius > 2.9

    back = run(room, profile, last, 3, fn _, _ -> Twist.new(-0.5, 0.0) end)
    assert {pose, _, _} = List.last(back)
    assert pose.x < last.x - 0.5
    turned = run(room, profile, last, 3, fn _, _ -> Twist.new(0.0, 0.8) end)
    assert {_, %{turn: turn}, []} = List.last(turned)
    assert turn == 0.8
  end

  test "whatever is wished, no body gets over the line" do
    for {profile, n} <- [{Profile.magellan(), 40}, {Profile.atrv_mini(), 40}], seed <- 1..n do
      :rand.seed(:exsss, {seed, n, 3})
      room = Enum.random([fence({{-3, -2}, {3, 2}}), nook()])
      pose = somewhere(room, profile)

      # Speeds that stay for a while, so that it gets somewhere, at the wildest rates.
      wish = fn _body, k ->
        if rem(k, 30) == 0 or Process.get(:wish) == nil do
          Process.put(
            :wish,
            Twist.new(
              Enum.random([-9.0, 0.2, 0.5, 9.0]),
              Enum.random([-9.0, -0.4, 0.0, 0.4, 9.0])
            )
          )
        end

        Process.get(:wish)
      end

      way = run(room, profile, pose, 30, wish)
      least = least(way, room)
      assert least >= profile.radius, "seed #{seed}, #{profile.name}: #{least}"
    end
  end

  defp somewhere(room, profile) do
    pose = Pose.new(6 * :rand.uniform() - 3, 4 * :rand.uniform() - 2, 6.28 * :rand.uniform())

    if Fence.clearance(room, Pose.point(pose)) > profile.radius + 0.1,
      do: pose,
      else: somewhere(room, profile)
  end

  test "set down over the line, it moves inward only, and slowly" do
    profile = Profile.magellan()

    for seed <- 1..40 do
      :rand.seed(:exsss, {seed, 1, 4})
      room = Enum.random([fence({{-3, -2}, {3, 2}}), nook()])
      angle = 6.28 * :rand.uniform()
      far = 3.0 + 2 * :rand.uniform()
      pose = Pose.new(far * :math.cos(angle), far * :math.sin(angle), 6.28 * :rand.uniform())
      before = Fence.clearance(room, Pose.point(pose))

      wish = fn _body, k ->
        if rem(k, 40) == 0,
          do: Process.put(:wish, {Enum.random([-0.5, 0.5]), Enum.random([-0.5, 0.0, 0.5])})

        {linear, turn} = Process.get(:wish)
        Twist.new(linear, turn)
      end

      way = run(room, profile, pose, 20, wish)
      # Wheels brake on for a moment when the way that was inward turns outward.
      assert least(way, room) >= min(before, profile.radius) - 0.03, "seed #{seed}"

      for {pose, rolls, _} <- way,
          Fence.clearance(room, Pose.point(pose)) < 0.0,
          do: assert(abs(rolls.linear) <= 0.2 + 1.0e-9)
    end
  end

  test "a robot over the line comes back when it is told to, and is as free as others then" do
    profile = Profile.magellan()
    room = fence({{-3, -2}, {3, 2}})

    way =
      run(room, profile, Pose.new(3.5, 0.0, :math.pi()), 20, fn _, _ -> Twist.new(0.5, 0.0) end)

    assert Enum.any?(way, fn {_, rolls, _} -> rolls.linear > 0.45 end)
    {last, _, _} = List.last(way)
    assert last.x < 0
  end

  test "not knowing where it is, it stands, and may turn" do
    profile = Profile.magellan()
    room = fence({{-3, -2}, {3, 2}})
    gate = gate(room, profile) |> Reflex.sense({:sonar, Body.silence(profile)}, 0) |> elem(0)
    at_zero = {:odometry, %Odometry{pose: Pose.new(0, 0), twist: Twist.zero()}}

    drive = fn gate, at_ms ->
      {gate, _urgency} = Reflex.sense(gate, {:sonar, Body.silence(profile)}, at_ms)
      Reflex.step(Reflex.wish(gate, Twist.new(0.3, 0.3), at_ms), at_ms)
    end

    assert {%{linear: v, turn: turn}, limits, _} = drive.(gate, 0)
    assert v == 0.0 and turn > 0 and :fence in limits
    {known, _urgency} = Reflex.sense(gate, at_zero, 1_000)
    assert {%{linear: v}, _, known} = drive.(known, 1_000)
    assert v > 0
    # For half a second; then it brakes.
    assert {_, limits, known} = drive.(known, 1_500)
    refute :fence in limits
    assert {_, limits, _} = drive.(known, 1_550)
    assert :fence in limits
  end

  test "odometry that begins again in another frame is not a place: it stands" do
    profile = Profile.magellan()
    room = fence({{-3, -2}, {3, 2}})
    [one, other] = [make_ref(), make_ref()]

    drive = fn gate, frame, x, at_ms ->
      odometry = %Odometry{pose: Pose.new(x, 0), twist: Twist.zero(), frame: frame}

      gate
      |> Reflex.sense({:sonar, Body.silence(profile)}, at_ms)
      |> elem(0)
      |> Reflex.sense({:odometry, odometry}, at_ms)
      |> elem(0)
      |> Reflex.wish(Twist.new(0.3, 0.0), at_ms)
      |> Reflex.step(at_ms)
    end

    assert {%{linear: v}, _, gate} = drive.(gate(room, profile), one, 2.0, 0)
    assert v > 0
    # It stands at the line, and its new odometry says that it is in the middle.
    {_, limits, gate} = drive.(gate, other, 0.0, 100)
    assert :fence in limits
    assert {%{linear: v}, [:fence], gate} = drive.(gate, other, 0.0, 200)
    assert v == 0.0

    # Nor does the gate that takes its place believe it.
    next = Reflex.new(profile, fence: room, frame: Reflex.frame(gate))
    assert {%{linear: v}, [:fence], _} = drive.(next, other, 0.0, 300)
    assert v == 0.0
    assert {%{linear: v}, _, _} = drive.(next, one, 0.0, 300)
    assert v > 0
  end

  test "the line is where the map has it, wherever the robot was switched on" do
    profile = Profile.magellan()
    room = fence({{10, 10}, {14, 14}})
    gate = gate(room, profile, Pose.new(12, 12, :math.pi() / 2))

    for {x, free?} <- [{0.0, true}, {1.75, false}] do
      odometry = {:odometry, %Odometry{pose: Pose.new(x, 0), twist: Twist.zero()}}

      {twist, _, _} =
        gate
        |> Reflex.sense({:sonar, Body.silence(profile)}, 0)
        |> elem(0)
        |> Reflex.sense(odometry, 0)
        |> elem(0)
        |> Reflex.wish(Twist.new(0.5, 0.0), 0)
        |> Reflex.step(0)

      assert twist.linear > 0 == free?
    end
  end

  test "shapes of no sense are named in a line" do
    base = [id: :fence1, profile: Profile.magellan(), drive: {Some.Drive, []}]
    assert {:ok, %{fence: %Fence{}}} = Robot.Config.new(base ++ [fence: {{0, 0}, {1, 2.5}}])
    assert {:ok, %{fence: nil, dry_run: false}} = Robot.Config.new(base)

    for {bad, part} <- [
          {:big, "polygon of 3 to 64"},
          {[], "polygon of 3 to 64"},
          {[{0, 0}, {1, 1}], "polygon of 3 to 64"},
          {List.duplicate({0, 0}, 65), "polygon of 3 to 64"},
          {[{0, 0}, {1, 0} | {2, 2}], "polygon of 3 to 64"},
          {[{0, 0}, {1, :nan}, {1, 1}], "from -10000 to 10000"},
          {{{0, 0}, {1.0e300, 1}}, "from -10000 to 10000"},
          {{{0, 0}, {0, 1}}, "do not cross"},
          {[{0, 0}, {2, 0}, {1, 0}], "do not cross"},
          {[{0, 0}, {2, 2}, {2, 0}, {0, 2}], "do not cross"},
          {[{0, 0}, {4, 0}, {4, 3}, {2, 0}, {0, 3}], "do not cross"}
        ] do
      assert {:error, line} = Robot.Config.new(base ++ [fence: bad])
      assert line =~ "option fence: expected" and line =~ part and not (line =~ "\n")
    end
  end
end
