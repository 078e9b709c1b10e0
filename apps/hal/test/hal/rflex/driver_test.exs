defmodule Hal.RFlex.DriverTest do
  use ExUnit.Case, async: true
  import Hal.Lines, only: [far!: 1]
  alias Hal.{Pose, RFlexBase, Serial, Twist}
  alias Hal.RFlex.Driver
  @moduletag :realtime
  doctest Hal.RFlex.Driver

  @conversions [distance: 31_387.0, angle: 4654.2, range: 1474.0, ir_a: 4000.0, ir_b: -2.0]

  @alive RFlexBase.report(3, 0, <<0::104>>)

  setup do
    Process.flag(:trap_exit, true)

    folder =
      Path.join(System.tmp_dir!(), "rflex_#{System.unique_integer([:positive])}_#{System.pid()}")

    File.mkdir_p!(folder)
    on_exit(fn -> File.rm_rf!(folder) end)
    {:ok, link: Path.join(folder, "line")}
  end

  # A driver in this process, and the far end of its line too: `heard` are the commands that came
  # there, `readings` what the driver said, both oldest first.
  defp open(link, options \\ []) do
    far = far!(link)
    driver = Keyword.merge([port: link, conversions: @conversions], options)
    {:ok, state} = Driver.init(driver)
    %{far: far, driver: state, bytes: <<>>, heard: [], at: [], readings: [], error: nil}
  end

  # Takes messages until `done?` of the test.
  defp until(t, done?, ms \\ 5_000) do
    until_deadline(t, done?, System.monotonic_time(:millisecond) + ms)
  end

  defp until_deadline(t, done?, deadline_ms) do
    cond do
      done?.(t) ->
        t

      t.error != nil ->
        flunk("error #{inspect(t.error)} after #{inspect(t.heard)}, #{inspect(t.readings)}")

      true ->
        receive do
          message -> t |> message(message) |> until_deadline(done?, deadline_ms)
        after
          max(deadline_ms - System.monotonic_time(:millisecond), 0) ->
            flunk("not in time: #{inspect(t.heard)}, #{inspect(t.readings)}")
        end
    end
  end

  defp message(t, message) do
    case Serial.handle(t.far, message) do
      {:data, bytes} ->
        {commands, rest} = RFlexBase.commands(t.bytes <> bytes)
        at_ms = System.monotonic_time(:millisecond)
        at = for command <- commands, do: {at_ms, command}
        %{t | bytes: rest, heard: t.heard ++ commands, at: t.at ++ at}

      {:error, reason} ->
        flunk("the far end: #{inspect(reason)}")

      :unknown ->
        case Driver.handle_message(message, t.driver) do
          {:ok, readings, driver} -> %{t | driver: driver, readings: t.readings ++ readings}
          {:error, reason, driver} -> %{t | driver: driver, error: reason}
        end
    end
  end

  # For so long, whatever comes.
  defp go_on(t, ms) do
    deadline = System.monotonic_time(:millisecond) + ms
    until(t, fn _ -> System.monotonic_time(:millisecond) >= deadline end, ms + 5_000)
  end

  defp drive(t, linear, turn) do
    {:ok, driver} = Driver.drive(Twist.new(linear, turn), t.driver)
    %{t | driver: driver}
  end

  # As a gate does: every 50 ms. A controller is there.
  defp keep_driving(t, linear, turn, times) do
    Enum.reduce(1..times, t, fn _, t ->
      t |> answer(@alive) |> drive(linear, turn) |> go_on(50)
    end)
  end

  defp answer(t, bytes) do
    :ok = Serial.write(t.far, bytes)
    t
  end

  defp forget(t), do: %{t | heard: [], at: [], readings: []}

  defp close(t) do
    :ok = Driver.terminate(t.driver)
    # The driver's own timers, which are late now, are nobody's.
    t = far_until(t, said?({:inputs, 0}))
    Serial.close(t.far)
    t
  end

  defp said?(command), do: fn t -> command in t.heard end
  defp told?(kind), do: fn t -> List.keymember?(t.readings, kind, 0) end

  test "it stops the wheels first, then says what the controller is to send", %{link: link} do
    t = until(open(link), said?({:infrared, 2}))
    assert [{:move, 0, 31_387}, {:turn, 0, 100_000} | _] = t.heard

    stops? = &(match?({:move, 0, _}, &1) or match?({:turn, 0, _}, &1) or &1 in [:brake, :status])

    assert Enum.reject(t.heard, stops?) == [
             {:reports, 100_000, 3},
             {:inputs, 100_000},
             :defaults,
             {:prepare, 0, 15_693},
             {:prepare, 1, 4654},
             {:sonar, 30_000, 1250, 0, 2},
             {:infrared, 2}
           ]

    t = until(t, said?(:brake))
    assert Enum.all?(t.heard, &(not match?({:move, speed, _} when speed != 0, &1)))
    close(t)
  end

  test "its readings", %{link: link} do
    t = open(link, home: 0x31, joystick: true) |> until(said?(:joystick))
    all = for id <- Enum.to_list(0..7) ++ Enum.to_list(16..23), do: {id, 1474}

    reports = [
      RFlexBase.wheels(100, 5000, 70),
      RFlexBase.wheels(200, 5000 + 3139, 70, {6277, 465}),
      RFlexBase.sonar([{23, 0xFFFF} | List.delete(all, {23, 1474})]),
      RFlexBase.report(6, 1, <<2, 0::32, 200, 100, 100::48, 0x80, 0::32, 100::64, 0x80>>),
      RFlexBase.input(0x41, 0x08),
      RFlexBase.input(0x31, 1),
      RFlexBase.status(2450, 0),
      RFlexBase.report(3, 0, <<0::32, -12::32, 40::32, 1>>),
      # Nobody knows these.
      RFlexBase.report(9, 9, <<1, 2, 3>>),
      RFlexBase.report(5, 0, <<0::64>>),
      RFlexBase.input(0x77, 1)
    ]

    t = t |> answer(Enum.join(reports)) |> until(told?(:joystick)) |> go_on(30)

    assert {:odometry, odometry} =
             t.readings |> Enum.filter(&match?({:odometry, _}, &1)) |> List.last()

    assert_in_delta odometry.pose.x, 0.1, 1.0e-3
    assert_in_delta odometry.twist.linear, 0.2, 1.0e-4
    assert_in_delta odometry.twist.turn, 0.0999, 1.0e-4
    assert {:sonar, sonar} = List.keyfind(t.readings, :sonar, 0)
    assert sonar == List.duplicate(1.0, 15) ++ [5.1]
    assert {:ir, [0.1, 0.4, 0.8 | _]} = List.keyfind(t.readings, :ir, 0)
    assert {:bumpers, [0]} in t.readings
    assert {:power, 24.5} in t.readings
    assert {:brake, false} in t.readings
    # 6 mm/s and -0.01 rad/s a count.
    assert {:joystick, %{twist: Twist.new(0.24, 0.12), held?: true}} in t.readings
    assert %{unknown: 3, packets: 13} = Driver.counts(t.driver)

    # Bumpers that stand are said again without any report. Ranges are not: they are as old as they are.
    t = t |> forget() |> until(told?(:bumpers)) |> go_on(150)
    refute told?(:sonar).(t)
    close(t)
  end

  test "a speed is ramped, repeated, never above the limit; a stop is the next on the wire", %{
    link: link
  } do
    t =
      open(link, limits: [max_linear: 0.3, max_turn: 0.8])
      |> until(said?({:infrared, 2}))
      |> forget()

    started = System.monotonic_time(:millisecond)
    t = keep_driving(t, 9.0, -9.0, 30)
    moves = for {:move, speed, _} <- t.heard, do: speed
    turns = for {:turn, speed, _} <- t.heard, do: speed
    assert :release in t.heard
    assert Enum.max(moves) == trunc(0.3 * 31_387)
    assert Enum.min(turns) == -trunc(0.8 * 4654.2)

    # Never faster than the accelerations allow, which are 0.5 m/s2 and 1 rad/s2; the first step may
    # be one of 0.05 s.
    for {at_ms, {axis, speed, _}} when axis in [:move, :turn] <- t.at do
      share = if axis == :move, do: speed / 31_387 / 0.5, else: -speed / 4654.2
      assert share <= (at_ms - started) / 1000 + 0.06
    end

    assert length(moves) >= 10

    t = t |> forget() |> drive(0.0, 0.0)
    # Written already, but for what has to wait for the pace; no other speed waits.
    waiting = for {key, _bytes} <- t.driver.queue.waiting, do: key
    assert Enum.take(waiting, 1) in [[{:speed, 0}], [{:speed, 1}]]
    assert length(for {:speed, _} = key <- waiting, do: key) <= 2

    t = until(t, fn t -> {:move, 0, 31_387} in t.heard and {:turn, 0, 100_000} in t.heard end)
    assert [_ | rest] = Enum.drop_while(t.heard, &(not match?({:move, 0, _}, &1)))
    refute Enum.any?(rest, fn command -> match?({:move, speed, _} when speed != 0, command) end)

    # It goes on saying so.
    t = t |> forget() |> until(fn t -> Enum.count(t.heard, &(&1 == {:move, 0, 31_387})) == 3 end)
    close(t)
  end

  def clock(counter), do: :counters.get(counter, 1)

  test "a driver that was held up begins from standing, with the brake", %{link: link} do
    counter = :counters.new(1, [])
    t = open(link, clock: {__MODULE__, :clock, [counter]})

    later = fn t, ms ->
      :counters.add(counter, 1, ms)
      t |> answer(@alive) |> drive(0.4, 0.0) |> go_on(15)
    end

    t = Enum.reduce(1..30, t, fn _, t -> later.(t, 50) end)
    assert_in_delta t.driver.ramp.twist.linear, 0.4, 1.0e-9
    t = t |> forget() |> later.(300)
    assert t.driver.ramp.twist.linear <= 0.1 + 1.0e-9
    t = Enum.reduce(1..8, t, fn _, t -> later.(t, 20) end)
    assert :release in t.heard
    close(t)
  end

  test "what is no speed is a stop", %{link: link} do
    t = open(link) |> until(said?({:infrared, 2})) |> keep_driving(0.4, 0.0, 5) |> forget()
    {:ok, driver} = Driver.drive(%Twist{linear: :nan, turn: 0.0}, t.driver)
    t = until(%{t | driver: driver}, said?({:move, 0, 31_387}))
    assert Driver.counts(t.driver).refused == 1
    close(t)
  end

  test "without its conversions it is not ready, says which, and only stops", %{link: link} do
    t = open(link, conversions: [angle: 4654.2]) |> until(said?(:brake))
    assert {:error, line} = Driver.ready(t.driver)
    assert line =~ "distance" and line =~ "range"
    refute line =~ "angle"
    t = t |> forget() |> answer(RFlexBase.wheels(1, 1, 1)) |> keep_driving(0.3, 0.5, 6)
    assert Enum.uniq(for {:move, speed, _} <- t.heard, do: speed) == [0]
    refute :release in t.heard
    refute told?(:odometry).(t)
    assert {:report, :wheels} in t.readings
    close(t)
  end

  test "half of a pair says that the base is there, once a whole pair was heard", %{link: link} do
    t = open(link) |> until(said?(:brake)) |> answer(RFlexBase.axis(0, 100, 5000)) |> go_on(60)
    refute told?(:report).(t) or told?(:odometry).(t)
    t = t |> answer(RFlexBase.wheels(200, 5000, 70)) |> until(told?(:odometry)) |> forget()
    t = t |> answer(RFlexBase.axis(1, 300, 70)) |> until(told?(:report))
    refute told?(:odometry).(t)
    # Of what is not believed, nothing.
    t = t |> forget() |> answer(RFlexBase.axis(1, 400, 2_000_000)) |> go_on(60)
    refute told?(:report).(t)
    close(t)
  end

  test "with them it is ready", %{link: link} do
    t = open(link) |> until(said?(:brake))
    assert Driver.ready(t.driver) == :ok
    close(t)
  end

  test "its end: both stops and the brake, twice, then silence is asked for", %{link: link} do
    t = open(link) |> until(said?(:brake)) |> keep_driving(0.3, 0.5, 4) |> forget() |> close()
    stop = [{:move, 0, 31_387}, {:turn, 0, 100_000}, :brake]
    silence = [{:sonar, 0, 0, 0, 0}, {:infrared, 0}, {:reports, 0, 0}, {:inputs, 0}]
    assert Enum.take(t.heard, -10) == stop ++ stop ++ silence
  end

  test "a driver that is killed: the stop and the brake are on the line", %{link: link} do
    far = far!(link)
    test = self()

    owner =
      spawn(fn ->
        {:ok, state} = Driver.init(port: link, conversions: @conversions)
        send(test, :open)
        alone(state)
      end)

    assert_receive :open
    t = %{far: far, bytes: <<>>, heard: [], at: [], readings: [], error: nil, driver: nil}
    t = far_until(t, said?(:status))
    Process.exit(owner, :kill)
    t = far_until(forget(t), fn t -> Enum.count(t.heard, &(&1 == :brake)) >= 2 end)
    assert Enum.take(t.heard, -3) == [{:move, 0, 31_387}, {:turn, 0, 100_000}, :brake]
    Serial.close(far)
  end

  # Only the far end is here.
  defp far_until(t, done?) do
    if done?.(t) do
      t
    else
      assert_receive message

      case Serial.handle(t.far, message) do
        {:data, bytes} ->
          {commands, rest} = RFlexBase.commands(t.bytes <> bytes)
          far_until(%{t | bytes: rest, heard: t.heard ++ commands}, done?)

        _other ->
          far_until(t, done?)
      end
    end
  end

  defp alone(state) do
    receive do
      message ->
        {:ok, _readings, state} = Driver.handle_message(message, state)
        alone(state)
    end
  end

  test "a brake that was set meanwhile is released again", %{link: link} do
    t =
      open(link)
      |> until(said?(:brake))
      |> keep_driving(0.3, 0.0, 6)
      |> answer(RFlexBase.status(2450, 1))

    t = t |> until(told?(:brake)) |> forget() |> keep_driving(0.3, 0.0, 4)
    assert :release in t.heard
    t = t |> answer(RFlexBase.status(2450, 0)) |> forget() |> until(told?(:brake)) |> go_on(60)
    t = t |> forget() |> keep_driving(0.3, 0.0, 4)
    refute :release in t.heard
    close(t)
  end

  test "a controller that starts again is told again, and the robot stays where it is", %{
    link: link
  } do
    t =
      open(link) |> until(said?({:infrared, 2})) |> answer(RFlexBase.wheels(90_000, 60_000, 4000))

    t =
      t
      |> answer(RFlexBase.wheels(90_100, 61_000, 4000))
      |> until(fn t -> Enum.count(t.readings, &match?({:odometry, _}, &1)) == 2 end)

    {:odometry, before} = List.last(t.readings)
    # It is silent, but for its battery.
    t = forget(t)

    t =
      until(t, fn t ->
        {:reports, 100_000, 3} in t.heard and {:sonar, 30_000, 1250, 0, 2} in t.heard
      end)

    t = Enum.reduce(0..3, t, &answer(&2, RFlexBase.wheels(100 * &1, 10 * &1, &1)))
    t = until(t, told?(:odometry)) |> go_on(30)
    {:odometry, now} = List.last(for {:odometry, _} = reading <- t.readings, do: reading)
    assert Pose.distance(before.pose, now.pose) < 0.01
    assert abs(Pose.wrap(before.pose.heading - now.pose.heading)) < 0.01
    assert Driver.counts(t.driver).jumps == 2
    # How far it went meanwhile, nobody has counted.
    assert is_reference(now.frame) and now.frame != before.frame
    close(t)
  end

  test "a controller that says nothing at all is an error; noise is nothing", %{link: link} do
    t = open(link) |> answer(:binary.copy(<<0x1B, 2, 0>>, 50))
    started = System.monotonic_time(:millisecond)

    t =
      until(t, fn t ->
        if is_nil(t.error) and :rand.uniform(5) == 1, do: answer(t, <<0x1B, 9, 2>>)
        t.error == :silent
      end)

    assert System.monotonic_time(:millisecond) - started >= 1900
    :ok = Driver.terminate(t.driver)
    Serial.close(t.far)
  end

  test "odometry of another process is in another frame", %{link: link} do
    [one, other] =
      for _process <- 1..2 do
        Task.await(
          Task.async(fn ->
            t = open(link) |> until(said?(:status)) |> answer(RFlexBase.wheels(1000, 0, 0))
            t = until(t, told?(:odometry))
            close(t)
            {:odometry, odometry} = List.keyfind(t.readings, :odometry, 0)
            odometry
          end)
        )
      end

    assert one.pose == other.pose
    assert is_reference(one.frame) and one.frame != other.frame
  end

  test "a line that is lost is an error; opened again, the way goes on", %{link: link} do
    t = open(link) |> until(said?(:status))
    t = t |> answer(RFlexBase.wheels(1000, 0, 0)) |> answer(RFlexBase.wheels(1100, 6277, 100))
    t = until(t, fn t -> Enum.count(t.readings, &match?({:odometry, _}, &1)) == 2 end)
    {:odometry, before} = List.last(t.readings)
    Serial.close(t.far)
    assert {:error, :unplugged} = lost(t.driver)
    :ok = Driver.terminate(t.driver)
    assert {:error, :enoent} = Driver.init(port: link, conversions: @conversions)

    t = open(link) |> answer(RFlexBase.wheels(1600, 6277, 100)) |> until(told?(:odometry))
    assert {:odometry, now} = List.keyfind(t.readings, :odometry, 0)
    assert now.pose == before.pose
    assert is_reference(now.frame) and now.frame == before.frame
    close(t)
  end

  defp lost(driver) do
    assert_receive message

    case Driver.handle_message(message, driver) do
      {:ok, _readings, driver} -> lost(driver)
      {:error, reason, _driver} -> {:error, reason}
    end
  end

  test "two in a hundred bytes damaged on the way here: it drives, and no reading leaps", %{
    link: link
  } do
    :rand.seed(:exsss, {9, 9, 9})
    t = open(link) |> until(said?({:infrared, 2})) |> drive(0.2, 0.0)

    t =
      Enum.reduce(1..60, t, fn k, t ->
        stream =
          RFlexBase.wheels(100 * k, 600 * k, 10 * k, {6277, 100}) <>
            RFlexBase.input(0x40, 0) <> RFlexBase.status(2450, 0)

        t |> answer(damage(stream, 0.02)) |> drive(0.2, 0.0) |> go_on(25)
      end)

    poses = for {:odometry, odometry} <- t.readings, do: odometry.pose
    assert length(poses) > 12
    whole = 60 * 600 / 31_387
    assert_in_delta List.last(poses).x, whole, 0.1
    for [a, b] <- Enum.chunk_every(poses, 2, 1, :discard), do: assert(Pose.distance(a, b) < 0.4)
    for {:move, speed, _} <- t.heard, do: assert(speed <= 15_693)
    close(t)
  end

  defp damage(bytes, rate) do
    for <<byte <- bytes>>, into: <<>> do
      case {:rand.uniform() < rate, :rand.uniform(3)} do
        {false, _} -> <<byte>>
        {true, 1} -> <<>>
        {true, 2} -> <<byte, byte>>
        {true, 3} -> <<Bitwise.bxor(byte, Bitwise.bsl(1, :rand.uniform(8) - 1))>>
      end
    end
  end

  test "wrong options are said when it starts" do
    assert_raise ArgumentError, ~r/pace_ms/, fn -> Driver.init(port: "/dev/null", pace_ms: 0) end
  end

  test "the console's phrase is all that is said there", %{link: link} do
    far = far!(link)
    assert Hal.RFlex.PowerSwitch.halt(port: link, phrase: "System halted") == :ok
    assert read(far, <<>>, 17) == "\r\nSystem halted\r\n"
    Serial.close(far)
    assert {:error, line} = Hal.RFlex.PowerSwitch.halt(port: link)
    assert line =~ "no such device"
    assert {:error, _} = Hal.RFlex.PowerSwitch.halt(port: link, phrase: "a\nb")
    assert {:error, _} = Hal.RFlex.PowerSwitch.halt(port: link, words: "x")
  end

  defp read(_far, bytes, size) when byte_size(bytes) >= size, do: bytes

  defp read(far, bytes, size) do
    assert_receive message

    case Serial.handle(far, message) do
      {:data, more} -> read(far, bytes <> more, size)
      :unknown -> read(far, bytes, size)
    end
  end
end
