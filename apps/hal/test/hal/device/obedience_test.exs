defmodule Hal.Device.ObedienceTest do
  use ExUnit.Case, async: true
  alias Hal.{Device, Odometry, Pose, Twist}
  alias Hal.Device.Obedience
  doctest Hal.Device.Obedience

  defp head(pan, tilt \\ 0.0), do: {:ptz, %{pan: pan, tilt: tilt, field_of_view: 0.8}}

  defp wheels(x, linear \\ 0.0) do
    twist = Twist.new(linear, 0.0)
    {:odometry, %Odometry{pose: Pose.new(x, 0.0), twist: twist, frame: :a}}
  end

  # The same reading ten times a second.
  defp hear(obedience, reading, from_ms..to_ms//_, reach \\ nil) do
    Enum.reduce(from_ms..to_ms//100, obedience, fn at_ms, obedience ->
      {_, _, obedience} = Obedience.heard(obedience, [reading], reach, at_ms)
      obedience
    end)
  end

  test "a refusal is told when it is the first in a row, then every 10 s, and counts for ever" do
    refusal = {:refused, :look, "no"}

    {told, obedience} =
      Enum.flat_map_reduce(0..25_000//1_000, Obedience.new(), fn at_ms, obedience ->
        {[], told, obedience} = Obedience.heard(obedience, [refusal], nil, at_ms)
        {Enum.map(told, &{&1, at_ms}), obedience}
      end)

    assert told == [look: 0, look: 10_000, look: 20_000]
    assert Obedience.judge(obedience, :ptz) == {:error, {:refuses, :look, "no"}}
    assert obedience.refusals.look.count == 26

    {[], [], obedience} = Obedience.heard(obedience, [{:obeyed, :look}], nil, 26_000)
    assert Obedience.judge(obedience, :ptz) == :ok
    {[], [:look], obedience} = Obedience.heard(obedience, [refusal], nil, 26_100)
    assert obedience.refusals.look.count == 27
    assert Obedience.opened(obedience).refusals.look.count == 27
  end

  test "what is no speed counts as a stop, and ends nothing" do
    for wrong <- [:nan, 1, nil] do
      told = Obedience.told(Obedience.new(), %Twist{linear: wrong, turn: 0.0})
      assert told |> hear(wheels(0.0), 0..4_000) |> Obedience.judge(:drive) == :ok
    end
  end

  test "one refusal, or three at once, are no reason to be offline" do
    refusal = {:refused, :zoom, "no"}
    {_, _, obedience} = Obedience.heard(Obedience.new(), List.duplicate(refusal, 3), nil, 0)
    assert Obedience.judge(obedience, :ptz) == :ok
    {_, _, obedience} = Obedience.heard(obedience, [refusal], nil, 2_000)
    assert {:error, {:refuses, :zoom, _}} = Obedience.judge(obedience, :ptz)
  end

  test "a head that moves obeys its looks, whatever was refused before" do
    refusals = for at_ms <- 0..3_000//1_000, do: {at_ms, {:refused, :look, "no"}}

    obedience =
      Enum.reduce(refusals, hear(Obedience.new(), head(0.0), 0..0), fn {at_ms, refusal}, o ->
        elem(Obedience.heard(o, [refusal], nil, at_ms), 2)
      end)

    assert {:error, {:refuses, :look, _}} = Obedience.judge(obedience, :ptz)
    assert obedience |> hear(head(0.1), 3_100..3_100) |> Obedience.judge(:ptz) == :ok
  end

  test "a head that stands where it should not, for 5 s; not one that is there, or on its way" do
    told = Obedience.told(Obedience.new(), {1.0, 0.0})
    assert told |> hear(head(0.0), 0..4_900) |> Obedience.judge(:ptz) == :ok
    stuck = hear(told, head(0.0), 0..5_000)
    assert Obedience.judge(stuck, :ptz) == {:error, {:stands, :head}}
    # Told to look where it stands, it has proven nothing yet.
    assert stuck
           |> Obedience.told({0.0, 0.0})
           |> hear(head(0.0), 5_100..9_000)
           |> Obedience.judge(:ptz) ==
             {:error, {:stands, :head}}

    assert stuck |> hear(head(0.03), 5_100..5_100) |> Obedience.judge(:ptz) == :ok
    assert told |> hear(head(0.97), 0..9_000) |> Obedience.judge(:ptz) == :ok
    assert hear(Obedience.new(), head(0.0), 0..9_000) |> Obedience.judge(:ptz) == :ok
  end

  test "a head at its end is where it should be; without a known reach it is not judged there" do
    told = Obedience.told(Obedience.new(), {3.0, 0.0})
    reach = {{-1.7, 1.7}, {-0.4, 0.4}}
    assert told |> hear(head(1.7), 0..9_000, reach) |> Obedience.judge(:ptz) == :ok

    assert told |> hear(head(1.2), 0..9_000, reach) |> Obedience.judge(:ptz) ==
             {:error, {:stands, :head}}

    turned = told |> hear(head(0.0), 0..100) |> hear(head(1.2), 200..9_000)
    assert Obedience.judge(turned, :ptz) == :ok
  end

  test "wheels that stand for 3 s, told to turn; not slow ones, or ones that turn unmeasured" do
    told = Obedience.told(Obedience.new(), Twist.new(0.2, 0.0))
    assert told |> hear(wheels(0.0), 0..2_900) |> Obedience.judge(:drive) == :ok
    stuck = hear(told, wheels(0.0), 0..3_000)
    assert Obedience.judge(stuck, :drive) == {:error, {:stands, :wheels}}
    assert stuck |> hear(wheels(0.0, 0.1), 3_100..3_100) |> Obedience.judge(:drive) == :ok
    assert stuck |> hear(wheels(0.02), 3_100..3_100) |> Obedience.judge(:drive) == :ok

    slow = Obedience.told(Obedience.new(), Twist.new(0.05, 0.1))
    assert slow |> hear(wheels(0.0), 0..9_000) |> Obedience.judge(:drive) == :ok

    # A base that measures no speed, but says where it is.
    moving = Enum.reduce(0..90, told, &hear(&2, wheels(&1 * 0.02), (&1 * 100)..(&1 * 100)))
    assert Obedience.judge(moving, :drive) == :ok
  end

  describe "a device" do
    setup do
      {:ok, clock} = Agent.start_link(fn -> 0 end)
      {:ok, clock: clock}
    end

    defp device(kind, driver, clock, options \\ []) do
      test = self()
      name = {test, kind}

      for what <- [:refusal, :odd] do
        told = fn _, _, about, _ ->
          if about[:robot] == test, do: send(test, {what, about[:request], about.line})
        end

        :ok = Hal.Event.attach({name, what}, [:hal, :device, what], told, nil)
        on_exit(fn -> Hal.Event.detach({name, what}) end)
      end

      start_supervised!(
        {Device,
         [
           kind: kind,
           driver: {driver, test: test, device: kind},
           sinks: [{Kernel, :send, [test]}],
           about: %{robot: test},
           clock: {Agent, :get, [clock, &Function.identity/1]}
         ] ++ options}
      )
    end

    defp later(clock, ms), do: Agent.update(clock, &(&1 + ms))

    test "of a user's own driver, which refuses, is told and offline; its readings go on", %{
      clock: clock
    } do
      pid = device(:ptz, Hal.FakePtz, clock)
      send(pid, {:readings, [head(0.0), {:odd, "it hums"}, {:odd, "it hums"}]})
      assert_receive {:health, :ptz, {:online, _}}
      assert_receive {:odd, nil, "it hums"}
      refute_received {:odd, nil, _}

      for _ <- 1..3 do
        later(clock, 1_100)
        send(pid, {:readings, [{:refused, :look, "its motor is hot"}, head(0.0)]})
        _ = :sys.get_state(pid)
      end

      assert_receive {:refusal, :look, "its motor is hot"}
      assert_receive {:health, :ptz, {{:offline, {:refuses, :look, "its motor is hot"}}, _}}
      send(pid, {:readings, [head(0.3)]})
      assert_receive {:ptz, %{pan: 0.3}}
      assert_receive {:health, :ptz, {:online, _}}
      refute_received {:refused, _, _}
      refute_received {:ptz, :terminate, _}
    end

    test "that never answers, and refuses, is not online by that", %{clock: clock} do
      pid = device(:camera, Hal.FakeCamera, clock)
      send(pid, {:readings, [{:refused, :next, "no film"}]})
      assert_receive {:refusal, :next, "no film"}
      refute_receive {:health, :camera, {:online, _}}, 50
    end

    test "whose head stands still is offline until it turns", %{clock: clock} do
      pid = device(:ptz, Hal.FakePtz, clock)
      Device.look(pid, 0.5, 0.0)

      for _ <- 1..6 do
        send(pid, {:readings, [head(0.0)]})
        _ = :sys.get_state(pid)
        later(clock, 1_000)
      end

      assert_receive {:health, :ptz, {{:offline, {:stands, :head}}, _}}
      send(pid, {:readings, [head(0.5)]})
      assert_receive {:health, :ptz, {:online, _}}
    end

    test "whose wheels stand still, told to turn, is offline, armed, and told so once", %{
      clock: clock
    } do
      pid = device(:drive, Hal.FakeDrive, clock)
      assert_receive {:arming, %{state: :armed}}

      stand(pid, clock)
      assert_receive {:health, :drive, {{:offline, {:stands, :wheels}}, _}}
      assert Device.arming(pid).state == :armed
      send(pid, {:readings, [wheels(0.3, 0.3)]})
      assert_receive {:health, :drive, {:online, _}}
    end

    test "whose wheels stand as with its emergency button pressed is disarmed, each time that a person has armed it",
         %{
           clock: clock
         } do
      pid = device(:drive, Hal.FakeDrive, clock, arm: :manual)
      send(pid, {:readings, [wheels(0.0), {:report, :wheels}]})

      for _ <- 1..2 do
        assert Device.arm(pid) == :ok
        assert_receive {:arming, %{state: :armed}}
        stand(pid, clock)
        assert_receive {:arming, %{state: :disarmed}}
      end

      assert_receive {:health, :drive, {{:offline, {:stands, :wheels}}, _}}
      # The button is released: what is wished now turns no wheel.
      Device.drive(pid, Twist.new(0.3, 0.0))
      assert Device.arming(pid).state == :disarmed
      assert Device.arming(pid).told == Twist.zero()
    end

    # Told to drive for 4 s, the wheels report that they stand.
    defp stand(pid, clock) do
      for _ <- 1..5 do
        Device.drive(pid, Twist.new(0.3, 0.0))
        send(pid, {:readings, [wheels(0.0), {:report, :wheels}]})
        _ = :sys.get_state(pid)
        later(clock, 400)
        send(pid, {:readings, [wheels(0.0), {:report, :wheels}]})
        _ = :sys.get_state(pid)
        later(clock, 400)
      end
    end
  end
end
