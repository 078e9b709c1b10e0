defmodule Sim.Emulator.RFlexControllerTest do
  @moduledoc "Tests the emulated controller against the fact sheet, and with noise."
  use ExUnit.Case, async: true
  alias Hal.{Odometry, Pose, Twist}
  alias Sim.Emulator.RFlexController, as: Controller
  alias Sim.Emulator.RFlexController
  alias Sim.Emulator.RFlexController.{Frame, Senses}
  doctest Sim.Emulator.RFlexController.Frame
  doctest Sim.Emulator.RFlexController.Options
  doctest Sim.Emulator.RFlexController.Senses
  doctest Sim.Emulator.RFlexController.Sonars

  defp hex(text), do: text |> String.replace(" ", "") |> Base.decode16!(case: :lower)

  # Section 14 of the sheet.
  @on "1b 02 02 00 22 08 00 01 86 a0 00 00 00 03 0c 1b 03"
  @release "1b 02 02 00 0c 00 0e 1b 03"
  @forward "1b 02 02 00 07 0e 00 00 00 18 85 00 00 3d 4d 00 00 75 30 01 a2 1b 03"
  @left "1b 02 02 00 07 0e 01 00 00 01 d1 00 01 86 a0 00 00 88 b8 01 cc 1b 03"
  @right "1b 02 02 00 07 0e 01 00 00 05 74 00 01 86 a0 00 00 88 b8 00 6c 1b 03"
  @inputs "1b 02 05 00 00 04 00 01 86 a0 26 1b 03"
  @sonar "1b 02 04 04 00 0d 00 00 75 30 00 00 04 e2 00 00 00 00 02 ac 1b 03"
  @infrared "1b 02 06 00 00 15 00 00 00 00 00 00 00 46 00 00 00 0a 00 00 00 14 00 00 00 96 02 df 1b 03"
  @status "1b 02 01 00 01 00 00 1b 03"

  defp controller(options \\ []) do
    {:ok, core} = Controller.new(options, 0)
    core
  end

  defp hear(core, text, at_ms), do: Controller.hear(core, hex(text), at_ms)

  # The frames that were sent by then, without their ids and time stamps.
  defp told(core, at_ms) do
    {bytes, _wishes, core} = Controller.run(core, at_ms)
    {frames(IO.iodata_to_binary(bytes)), core}
  end

  defp frames(<<>>), do: []

  defp frames(
         <<0x1B, 0x02, port, id, opcode, n, data::binary-size(n), sum, 0x1B, 0x03, rest::binary>>
       ) do
    inside = <<port, id, opcode, n, data::binary>>
    assert for(<<b <- inside>>, reduce: 0, do: (x -> Bitwise.bxor(x, b))) == sum
    [{port, opcode, data} | frames(rest)]
  end

  # With a ghost byte after the length.
  defp frames(
         <<0x1B, 0x02, 6, id, 1, 0x1B, 0x1B, data::binary-size(27), sum, 0x1B, 0x03,
           rest::binary>>
       ),
       do: frames(<<0x1B, 0x02, 6, id, 1, 27, data::binary, sum, 0x1B, 0x03, rest::binary>>)

  defp wanted(core, at_ms) do
    {_bytes, _wishes, core} = Controller.run(core, at_ms)
    {Sim.Emulator.RFlexController.Motors.wanted(core.motors), core}
  end

  defp odometry(pose, v \\ 0.0, w \\ 0.0),
    do: {:odometry, %Odometry{pose: pose, twist: Twist.new(v, w)}}

  describe "worked examples" do
    test "reports, byte for byte" do
      for {id, report, bytes} <- [
            {0x07, RFlexController.Report.motor(5000, 0, {-31_387, -6277}, {3138, 30_000}),
             "1b 02 02 07 21 19 00 00 00 00 00 00 13 88 00 ff ff 85 65 ff ff e7 7b 00 00 0c 42 00 00 75 30 d1 1b 03"},
            {0x08, RFlexController.Report.motor(5000, 1, {7311, -1396}, {100_000, 35_000}),
             "1b 02 02 08 21 19 00 00 00 00 00 00 13 88 01 00 00 1c 8f ff ff fa 8c 00 01 86 a0 00 00 88 b8 5a 1b 03"},
            {0x09, RFlexController.Report.sonar(5000, [{0, 1474}, {0x10, 2948}]),
             "1b 02 04 09 02 0e 00 00 00 00 00 00 13 88 00 05 c2 10 0b 84 c2 1b 03"},
            {0x12,
             RFlexController.Report.sonar(
               0x8D1,
               for(
                 {n, k} <- Enum.with_index(Enum.to_list(0..7) ++ Enum.to_list(16..23)),
                 do: {n, 1474 + 10 * k}
               )
             ),
             "1b 02 04 12 02 38 00 00 00 00 00 00 08 d1 00 05 c2 01 05 cc 02 05 d6 03 05 e0 04 05 ea 05 05 f4 06 05 fe 07 06 08 10 06 12 11 06 1c 12 06 26 13 06 30 14 06 3a 15 06 44 16 06 4e 17 06 58 56 1b 03"},
            {0x13, RFlexController.Report.input(0x8D1, 0x40, 5),
             "1b 02 05 13 01 07 00 00 08 d1 40 00 05 8c 1b 03"},
            {0x13, RFlexController.Report.input(0x8D1, 0x41, 0x80),
             "1b 02 05 13 01 07 00 00 08 d1 41 00 80 08 1b 03"},
            {0x14,
             RFlexController.Report.infrared(0x8D1, [
               Enum.to_list(100..107),
               Enum.to_list(120..127)
             ]),
             "1b 02 06 14 01 1b 1b 02 00 00 08 d1 64 65 66 67 68 69 6a 6b 80 00 00 08 d1 78 79 7a 7b 7c 7d 7e 7f 80 0a 1b 03"},
            {0x00, RFlexController.Report.status(0x8F5, 2450, false),
             "1b 02 01 00 01 09 00 00 08 f5 00 00 09 92 00 6f 1b 03"},
            {0x05, RFlexController.Report.joystick(5000, -12, 40, 1),
             "1b 02 03 05 00 0d 00 00 13 88 ff ff ff f4 00 00 00 28 01 b2 1b 03"},
            {0x0C, RFlexController.Report.row(5000, 17, <<1, 2, 4, 8>>),
             "1b 02 01 0c 00 0a 00 00 13 88 11 04 01 02 04 08 86 1b 03"}
          ] do
        {port, opcode, data} = report
        assert Frame.encode({port, id, opcode, data}, :infrared) == hex(bytes)
      end

      {port, opcode, data} =
        RFlexController.Report.infrared(5000, [List.duplicate(100, 8), List.duplicate(150, 8)])

      assert Frame.encode({port, 0x0B, opcode, data}, :off) ==
               hex(
                 "1b 02 06 0b 01 1b 02 00 00 13 88 64 64 64 64 64 64 64 64 80 00 00 13 88 96 96 96 96 96 96 96 96 80 15 1b 03"
               )
    end

    test "orders, and their effects" do
      core = controller() |> hear(@release, 0) |> hear(@forward, 0) |> hear(@left, 0)
      {twist, core} = wanted(core, 500)
      # 15693 counts/s2 from rest would be past 6277 counts/s after 0.4 s.
      assert_in_delta twist.linear, 6277 / 31_387, 1.0e-9
      assert_in_delta twist.turn, 465 / 4654.2, 1.0e-9
      {twist, core} = core |> hear(@right, 500) |> wanted(900)
      assert_in_delta twist.turn, -1396 / 4654.2, 1.0e-9
      # Stop, both axes.
      core =
        core
        |> hear("1b 02 02 00 07 0e 00 00 00 00 00 00 00 3d 4d 00 00 75 30 01 3f 1b 03", 900)
        |> hear("1b 02 02 00 07 0e 01 00 00 00 00 00 01 86 a0 00 00 88 b8 01 1c 1b 03", 900)

      {twist, core} = wanted(core, 1000)
      assert_in_delta twist.linear, 0.2 - 0.05, 0.001
      assert {%Twist{linear: v, turn: w}, core} = wanted(core, 2000)
      assert {v, w} == {0.0, 0.0}
      assert core.counts == %{frames: 6, bad: 0, unknown: 0, lost: 0, escaped: 0}
    end

    test "frames of an ATRV mini" do
      core =
        controller(kind: :atrv_mini)
        |> hear(@release, 0)
        |> hear("1b 02 02 00 07 0e 00 00 00 b9 8c 00 00 25 1c 00 00 75 30 01 43 1b 03", 0)
        |> hear("1b 02 02 00 07 0e 01 00 00 2e e0 00 01 86 a0 00 00 88 b8 01 d2 1b 03", 0)

      {twist, core} = wanted(core, 1000)
      assert_in_delta twist.linear, 0.05, 1.0e-9
      assert_in_delta twist.turn, 0.2, 1.0e-9
      assert core.counts.frames == 3
    end

    test "all reports on, and off" do
      core =
        controller()
        |> Controller.feel({:sonar, List.duplicate(1.0, 16)}, 0)
        |> Controller.feel({:ir, List.duplicate(0.4, 16)}, 0)
        |> Controller.feel({:power, 24.5}, 0)
        |> hear(@on, 0)
        |> hear(@inputs, 0)
        |> hear(@sonar, 0)
        |> hear(@infrared, 0)
        |> hear(@status, 0)
        |> hear("1b 02 03 00 00 00 03 1b 03", 0)

      assert {[{5, 0, _}, {1, 1, <<0::32, 2450::32, 1>>}, {3, 0, <<0::104>>}], core} =
               told(core, 0)

      assert {[], core} = told(core, 99)
      assert Controller.next_ms(core) == 100

      assert {[
                {2, 33, <<0::32, 100::32, 0, _::128>>},
                {2, 33, <<_::64, 1, _::128>>},
                {5, 1, <<100::32, 0x40, 0::16>>},
                {5, 1, <<_::32, 0x41, 0::16>>}
              ], core} = told(core, 100)

      # Four sonars at 31.25 ms each.
      assert Controller.next_ms(core) == 125
      assert {[{4, 2, <<0::32, 125::32, echoes::binary>>}], core} = told(core, 125)
      assert echoes == <<0, 1474::16, 1, 1474::16, 2, 1474::16, 3, 1474::16>>
      assert {[{6, 1, <<2, 150::32, 100, 100, _::binary>>}], core} = told(core, 150)

      off =
        core
        |> hear("1b 02 02 00 22 08 00 00 00 00 00 00 00 00 28 1b 03", 150)
        |> hear("1b 02 05 04 00 04 00 00 00 00 05 1b 03", 150)
        |> hear("1b 02 04 04 00 0d 00 00 00 00 00 00 00 00 00 00 00 00 00 0d 1b 03", 150)
        |> hear("1b 02 06 00 00 15" <> String.duplicate(" 00", 21) <> " 13 1b 03", 150)

      assert off.counts.unknown == 0
      assert {[{5, 0, _}], off} = told(off, 5_000)
      assert Controller.next_ms(off) == nil
    end
  end

  describe "sonars" do
    defp sweep(options, ranges, sonar \\ @sonar) do
      core = controller(options) |> Controller.feel({:sonar, ranges}, 0) |> hear(sonar, 0)

      {echoes, _core} =
        Enum.map_reduce(Enum.to_list(1..500), core, fn at_ms, core ->
          {frames, core} = told(core, at_ms)

          {for(
             {4, 2, <<_::64, echoes::binary>>} <- frames,
             <<id, raw::16 <- echoes>>,
             do: {id, raw}
           ), core}
        end)

      List.flatten(echoes)
    end

    test "each board counts from sixteen times its number; a sweep takes 16 times 31.25 ms" do
      echoes = sweep([], for(k <- 0..15, do: 1 + k / 10))
      assert Enum.map(echoes, &elem(&1, 0)) == Enum.to_list(0..7) ++ Enum.to_list(16..23)
      assert List.last(echoes) == {23, trunc(2.5 * 1474)}
    end

    test "an echo that is not heard in time is missed" do
      ranges = [5.1, 0.2 | List.duplicate(3.0, 14)]
      assert [{0, 0x7FFF}, {1, 294} | _] = sweep([], ranges)
      assert [{0, 0xFFFF} | _] = sweep([missed_echo: 0xFFFF], ranges)
      # 3 ms of listening is half a metre.
      short =
        Frame.encode({4, 4, 0, <<3000::32, 28_250::32, 0::32, 2>>}, :off)
        |> Base.encode16(case: :lower)

      echoes = sweep([], ranges, short)
      assert Enum.at(echoes, 0) == {0, 0x7FFF}
      assert Enum.at(echoes, 1) == {1, 294}
      assert Enum.at(echoes, 2) == {2, 0x7FFF}
    end

    test "a delayed controller does not make up for lost sweeps, and delays of 0 come to an end" do
      all = Frame.encode({4, 4, 0, <<0::32, 0::32, 0::32, 2>>}, :off)

      core =
        controller()
        |> Controller.feel({:sonar, List.duplicate(1.0, 16)}, 0)
        |> Controller.hear(all, 0)

      {frames, core} = told(core, 3_600_000)
      assert length(frames) in 1..8
      assert Controller.next_ms(core) == 3_600_001
    end
  end

  describe "infrared" do
    test "is wired as the sheet says, and its bytes are those of its formula" do
      {:ok, options} = Sim.Emulator.RFlexController.Options.check([])
      # One wall each: 0.1 m at the profile's number 15, on the right; 0.793 m at 11, in front.
      ranges = List.duplicate(2.0, 16) |> List.replace_at(15, 0.1) |> List.replace_at(11, 0.793)
      [rear, front] = Senses.infrared(ranges, options)
      assert Enum.uniq(rear) == [58]
      # Right-front quadrant outwards, then from the left to the front.
      assert front == [58, 58, 58, 200, 58, 58, 58, 71]
    end

    test "with a ghost byte where its length is 1B, or without" do
      feel = &Controller.feel(&1, {:ir, List.duplicate(0.4, 16)}, 0)
      {with_it, _, _} = controller() |> feel.() |> hear(@infrared, 0) |> Controller.run(150)

      {without, _, _} =
        controller(ghost: :off) |> feel.() |> hear(@infrared, 0) |> Controller.run(150)

      assert IO.iodata_length(with_it) == IO.iodata_length(without) + 1
      assert <<0x1B, 0x02, 6, 0, 1, 0x1B, 0x1B, 2, _::binary>> = IO.iodata_to_binary(with_it)
    end

    test "or a ghost byte wherever there is a 1B" do
      core = controller(ghost: :all, id: 0x1B) |> hear(@status, 0)
      {bytes, _, _} = Controller.run(core, 0)
      assert <<0x1B, 0x02, 1, 0x1B, 0x1B, 1, 9, _::binary>> = IO.iodata_to_binary(bytes)
    end
  end

  describe "bumpers" do
    test "are reported when they change, if anybody wants to know" do
      assert {[], _} = controller() |> Controller.feel({:bumpers, [0]}, 0) |> told(0)
      {_, core} = controller() |> hear(@inputs, 0) |> told(0)

      assert {[{5, 1, <<_::32, 0x41, 0x08::16>>}], core} =
               core |> Controller.feel({:bumpers, [0]}, 10) |> told(10)

      assert {[], core} = core |> Controller.feel({:bumpers, [0]}, 20) |> told(20)

      assert {[{5, 1, <<_::32, 0x40, 0x80::16>>}, {5, 1, <<_::32, 0x41, 0::16>>}], _} =
               core |> Controller.feel({:bumpers, [4]}, 30) |> told(30)
    end

    test "each have an address in the other style" do
      {:ok, options} =
        Sim.Emulator.RFlexController.Options.check(bumper_style: :address, bumpers: 14)

      inputs = Senses.inputs([4], options)
      assert Enum.sort(Map.keys(inputs)) == Enum.to_list(0x40..0x4D)
      assert for({a, 1} <- inputs, do: a) == [0x46]
    end
  end

  describe "counters" do
    test "count distances and turns, and wrap at 32 bits" do
      core = controller(counters: {0x7FFFFFFF - 100, -0x80000000 + 100})
      core = core |> hear(@on, 0) |> Controller.feel(odometry(Pose.new(0, 0, 3.0)), 0)
      core = Controller.feel(core, odometry(Pose.new(0, 0, -3.0), 0.1, -0.2), 50)

      core =
        Controller.feel(core, odometry(Pose.compose(Pose.new(0, 0, -3.0), Pose.new(1, 0))), 100)

      {[{2, 33, way}, {2, 33, turn}], _} = told(core, 100)
      <<_::72, position::signed-32, 0::32, _::64>> = way
      assert position == 0x7FFFFFFF - 100 + 31_387 - 0x100000000
      <<_::72, bearing::signed-32, _::binary>> = turn
      assert bearing == -0x80000000 + 100 + round((2 * :math.pi() - 6) * 4654.2)
      # Across the end in the other direction.
      core =
        controller(counters: {0, -0x80000000 + 100})
        |> hear(@on, 0)
        |> Controller.feel(odometry(Pose.new(0, 0)), 0)

      {[_, {2, 33, turn}], _} =
        core |> Controller.feel(odometry(Pose.new(0, 0, -0.1)), 50) |> told(100)

      <<_::72, bearing::signed-32, _::binary>> = turn
      assert bearing == 0x80000000 + 100 - 465
    end

    test "lose nothing when readings get lost on a straight way or a turn on the spot" do
      core = controller() |> Controller.feel(odometry(Pose.new(0, 0)), 0)
      core = Controller.feel(core, odometry(Pose.new(-2, 0)), 500)
      assert Sim.Emulator.RFlexController.Motors.counts(core.motors, 0) == {-62_774, 0}
    end
  end

  describe "the wheels" do
    test "stand while the brake is set, and accept nothing meanwhile" do
      core = controller() |> hear(@forward, 0)
      {twist, core} = wanted(core, 1000)
      assert twist == Twist.zero()
      {twist, core} = core |> hear(@release, 1000) |> wanted(1500)
      assert twist == Twist.zero()
      {twist, core} = core |> hear(@forward, 1500) |> wanted(2000)
      assert twist.linear > 0.19
      {twist, _} = core |> hear("1b 02 02 00 0b 00 09 1b 03", 2000) |> wanted(2000)
      assert twist == Twist.zero()
    end

    test "get no faster than a base can, however a command is damaged, and stop from there in time" do
      motors = fn core ->
        Sim.Emulator.RFlexController.Motors.command(
          core.motors,
          0,
          2_000_000_000,
          2_000_000_000,
          30_000,
          0
        )
      end

      core = controller(brake: :released)
      {twist, core} = wanted(%{core | motors: motors.(core)}, 100)
      assert_in_delta twist.linear, 2.5, 1.0e-6

      # The next command, 0.1 s later, is correct again: 1 m/s2.
      stop = Sim.Emulator.RFlexController.Motors.command(core.motors, 0, 0, 31_387, 30_000, 100)
      {twist, _core} = wanted(%{core | motors: stop}, 2_650)
      assert twist == Twist.zero()
    end

    test "stop by themselves if no command comes" do
      core = controller(timeout_ms: 700, brake: :released) |> hear(@forward, 0)
      {twist, core} = wanted(core, 699)
      assert twist.linear > 0.19
      assert Controller.next_ms(core) == 700
      {twist, core} = wanted(core, 900)
      assert_in_delta twist.linear, 0.1, 0.001
      assert {%Twist{linear: linear}, _} = wanted(core, 2000)
      assert linear == 0.0

      {twist, _} =
        controller(timeout_ms: :off, brake: :released) |> hear(@forward, 0) |> wanted(100_000)

      assert twist.linear > 0.19
    end

    test "keep their acceleration after an acceleration of 0, which only the first commands have" do
      # The sheet's first two commands: no speed, torque 0, direction 0.
      core =
        controller(brake: :released)
        |> hear("1b 02 02 00 07 0e 00 00 00 00 00 00 00 3d 4d 00 00 00 00 00 7b 1b 03", 0)
        |> hear("1b 02 02 00 07 0e 01 00 00 00 00 00 00 09 17 00 00 00 00 00 14 1b 03", 0)

      assert {%Twist{linear: linear, turn: turn}, core} = wanted(core, 1000)
      assert {linear, turn} == {0.0, 0.0}
      assert core.counts.frames == 2
    end

    test "do not accept a turn with a 1B in its top or third byte" do
      for {speed, escaped} <- [
            {0x1B00, 1},
            {0x1B000000, 1},
            {0x1AFF, 0},
            {0x001B0001, 0},
            {0x1B, 0}
          ] do
        frame = Frame.encode({2, 0, 7, <<1, speed::32, 100_000_000::32, 1::32, 1>>}, :off)
        core = controller(brake: :released) |> Controller.hear(frame, 0)
        assert core.counts.escaped == escaped
        {twist, _} = wanted(core, 100)
        assert twist.turn == 0.0 == (escaped == 1)
      end
    end

    test "are sent to the body when they change, and from time to time" do
      core = controller(brake: :released)
      {_, [{:drive, _}], core} = Controller.run(core, 0)
      {_, [], core} = Controller.run(core, 50)
      {_, [{:drive, _}], core} = Controller.run(core, 100)
      {_, [{:drive, twist}], _} = core |> hear(@forward, 110) |> Controller.run(120)
      assert_in_delta twist.linear, 0.005, 1.0e-4
    end
  end

  describe "the line" do
    test "orders may arrive in any pieces, and after any noise" do
      noise =
        for _ <- 1..200, into: <<>>, do: <<Enum.random([0x1B, 0x02, 0x03, Enum.random(0..255)])>>

      good = hex(@release) <> hex(@forward)

      for split <- 0..byte_size(good) do
        {first, second} = :erlang.split_binary(good, split)
        core = controller() |> Controller.hear(first, 0) |> Controller.hear(second, 10)
        assert core.counts.frames == 2
      end

      # Noise may end with a beginning, which then delays the first good frame until it is given
      # up.
      core = controller() |> Controller.hear(noise <> good <> good, 0)
      {_, _, core} = Controller.run(core, 50)
      assert core.counts.frames >= 2
    end

    test "the controller waits for the rest of a frame, but not for ever" do
      beginning = <<0x1B, 0x02, 2, 0, 7, 14, 0>>
      core = controller() |> Controller.hear(beginning, 0)
      assert Controller.next_ms(core) == 50
      {_, _, core} = Controller.run(core, 50)
      assert core.buffer == <<>>
      assert core.counts.bad == 1
      core = core |> hear(@release, 60)
      assert core.counts.frames == 1
    end

    test "ten thousand random buffers leave nothing behind, and crash nothing" do
      :rand.seed(:exsss, {1, 2, 3})

      core =
        for k <- 1..10_000, reduce: controller() do
          core ->
            bytes =
              for _ <- 1..:rand.uniform(40),
                  into: <<>>,
                  do:
                    <<if(:rand.uniform() < 0.3,
                        do: Enum.random([0x1B, 0x02, 0x03, 14]),
                        else: :rand.uniform(256) - 1
                      )>>

            core = Controller.hear(core, bytes, 10 * k)
            assert byte_size(core.buffer) < 50
            {_bytes, _wishes, core} = Controller.run(core, 10 * k)
            core
        end

      assert core.counts.bad > 100
    end

    test "orders too close together are lost" do
      core = controller(pace: {10, 4})
      core = for _ <- 1..6, reduce: core, do: (core -> hear(core, @status, 0))
      assert core.counts.lost == 2
      assert {[_], core} = told(core, 0)
      assert Controller.next_ms(core) == 10
      assert {[_, _], core} = told(core, 20)
      assert {[_], core} = told(core, 30)
      assert {[], core} = told(core, 1000)
      assert Controller.next_ms(core) == nil
      # Ten milliseconds apart, none is lost.
      core =
        for k <- 1..50,
            reduce: core,
            do: (core -> core |> hear(@status, 2000 + 10 * k) |> told(2000 + 10 * k) |> elem(1))

      assert core.counts.lost == 2
    end

    test "the phrase switches it off, in whatever pieces it arrives" do
      for {a, b} <- [{"The system is halted", ""}, {"xxThe sys", "tem is haltedyy"}] do
        core = controller(brake: :released) |> hear(@on, 0) |> hear(@forward, 0)
        {_, core} = wanted(core, 100)
        core = core |> Controller.hear(a, 110) |> Controller.hear(b, 120)
        assert {_, [{:drive, twist}], core} = Controller.run(core, 200)
        assert twist == Twist.zero()
        assert Controller.next_ms(core) == nil
        core = hear(core, @status, 300)
        assert {[], core} = told(core, 400)
        core = Controller.restart(core, 500) |> hear(@status, 500)
        assert {[{1, 1, <<0::32, _::40>>}], _} = told(core, 500)
      end

      other = controller(phrase: "System halted") |> Controller.hear("The system is halted", 0)
      refute other.off?
    end

    test "a restart forgets everything but the world" do
      core =
        controller()
        |> Controller.feel({:power, 25.0}, 0)
        |> hear(@on, 0)
        |> hear(@release, 0)
        |> hear(@forward, 0)

      core = Controller.restart(core, 1000)
      assert Controller.next_ms(core) == nil
      {twist, core} = wanted(core, 2000)
      assert twist == Twist.zero()
      assert {[{1, 1, <<1500::32, 2500::32, 1>>}], _} = core |> hear(@status, 2500) |> told(2500)
    end
  end

  test "the home switch is closed between its bearings" do
    {_, core} = controller(home: {0x31, 0.5, 1.0}) |> hear(@inputs, 0) |> told(0)
    core = Controller.feel(core, odometry(Pose.new(0, 0, 0.0)), 0)

    events =
      for k <- 1..70, reduce: {[], core} do
        {events, core} ->
          core = Controller.feel(core, odometry(Pose.new(0, 0, 0.1 * k)), k)
          {frames, core} = told(core, k)
          {events ++ for({5, 1, <<_::32, 0x31, state::16>>} <- frames, do: {k, state}), core}
      end
      |> elem(0)

    assert [{5, 1}, {11, 0}, {68, 1}] = events
  end

  test "the screen is blank, and the joystick is where it is held" do
    {rows, core} = controller() |> hear("1b 02 01 00 00 00 01 1b 03", 0) |> told(0)
    assert length(rows) == 240
    assert {1, 0, <<_::32, 239, 40, 0::320>>} = List.last(rows)
    core = core |> Controller.stick(-12, 40, 1) |> hear("1b 02 03 00 00 00 03 1b 03", 10)
    assert {[{3, 0, <<10::32, -12::signed-32, 40::32, 1>>}], _} = told(core, 10)
  end

  test "invalid options are named" do
    for {option, value} <- [
          kind: :b21r,
          conversions: [distance: 0],
          sonar_banks: [17],
          missed_echo: -1,
          timeout_ms: 0,
          brake: true,
          pace: 5,
          phrase: "",
          home: {1, 2},
          counters: 5,
          nonsense: 1
        ] do
      assert {:error, line} = Controller.new([{option, value}], 0)
      assert line =~ ~r/option #{option}[.: ]/
      refute line =~ "\n"
    end
  end
end
