defmodule Hal.RFlex.PartsTest do
  use ExUnit.Case, async: true
  alias Hal.RFlex.Protocol.Queue
  alias Hal.RFlex.Sensors.{Bumpers, Infrared, Sonar}
  doctest Hal.RFlex.Sensors.Bumpers
  doctest Hal.RFlex.Conversions
  doctest Hal.RFlex.PowerSwitch
  doctest Hal.RFlex.Sensors.IndexSwitch
  doctest Hal.RFlex.OptionCheck
  doctest Hal.RFlex.Sensors.Infrared
  doctest Hal.RFlex.Protocol.Queue
  doctest Hal.RFlex.Sensors.Sonar

  describe "sonar" do
    test "banks, a missing echo, what is nearer than it can be, ids of nobody" do
      sonar = Sonar.new([8, 8], 16, 1, 1474.0, 0.15, 5.1)
      all = for id <- Enum.to_list(0..7) ++ Enum.to_list(16..23), do: {id, 1474 + 10 * id}
      sonar = Sonar.report(sonar, all, 0)
      assert [1.0, second | _] = Sonar.ranges(sonar, 0)
      assert_in_delta second, 1484 / 1474, 1.0e-9
      assert_in_delta Enum.at(Sonar.ranges(sonar, 0), 8), 1634 / 1474, 1.0e-9

      sonar = Sonar.report(sonar, [{16, 0xFFFF}, {23, 0x7FFF}, {0, 1}, {8, 5}, {200, 5}], 10)
      ranges = Sonar.ranges(sonar, 10)
      assert {hd(ranges), Enum.at(ranges, 8), List.last(ranges)} == {0.15, 5.1, 5.1}
      assert sonar.unknown == 2
    end

    test "parts of a sweep come together; who falls silent takes all along" do
      sonar = Sonar.new([2, 1], 16, 1, 1000.0, 0.15, 5.1)
      sonar = Sonar.report(sonar, [{0, 1000}], 0)
      assert Sonar.ranges(sonar, 0) == nil
      sonar = sonar |> Sonar.report([{1, 2000}], 100) |> Sonar.report([{16, 3000}], 200)
      assert Sonar.ranges(sonar, 200) == [1.0, 2.0, 3.0]
      assert Sonar.ranges(sonar, 1200) == [1.0, 2.0, 3.0]
      assert Sonar.ranges(sonar, 1201) == nil
      # The others go on, and the first has said nothing since 0.
      sonar = Sonar.report(sonar, [{1, 2000}, {16, 3000}], 1500)
      assert Sonar.ranges(sonar, 2000) == [1.0, 2.0, 3.0]
      assert Sonar.ranges(sonar, 2001) == nil
    end

    test "age: the least of the last readings" do
      sonar = Sonar.new([1], 16, 3, 1000.0, 0.15, 5.1)

      seen =
        Enum.scan([2000, 1500, 3000, 4000, 4500], sonar, &Sonar.report(&2, [{0, &1}], 0))
        |> Enum.map(&Sonar.ranges(&1, 0))

      assert seen == [[2.0], [1.5], [1.5], [1.5], [3.0]]
    end

    test "none fitted" do
      assert Sonar.ranges(Sonar.new([], 16, 1, 1000.0, 0.15, 5.1), 0) == nil
    end
  end

  describe "infrared" do
    @laws %{metres: {4000.0, -2.0}, millimetres: {0.0005456, -2.086}}

    defp infrared(law, least \\ 0.0) do
      %Infrared{
        banks: [8, 8],
        base: 0,
        order: Enum.to_list(0..15),
        laws: List.duplicate(@laws[law], 16),
        law: law,
        least: least,
        greatest: 0.8
      }
    end

    test "both laws, by the sheet's examples" do
      banks = [<<71, 100, 200, 0, 0, 0, 0, 1>>, <<255, 255, 255, 255, 255, 255, 255, 255>>]
      assert [a, b, c, 0.8, _, _, _, 0.8 | _] = Infrared.ranges(infrared(:metres), banks)
      assert_in_delta a, 0.793, 0.001
      assert_in_delta b, 0.400, 0.001
      assert_in_delta c, 0.100, 0.001

      banks = [<<80, 100, 150, 200, 1, 1, 1, 1>>, <<0::64>>]
      assert [a, b, c, d | _] = Infrared.ranges(infrared(:millimetres), banks)

      for {range, mm} <- [{a, 687}, {b, 431}, {c, 185}, {d, 101}],
          do: assert_in_delta(range * 1000, mm, 1)
    end

    test "the order of a Magellan's poses" do
      infrared = %{
        infrared(:metres)
        | order: Infrared.magellan_order(),
          laws: List.duplicate({0.001, 1.0}, 16)
      }

      banks = [<<0, 1, 2, 3, 4, 5, 6, 7>>, <<8, 9, 10, 11, 12, 13, 14, 15>>]
      thousandths = for range <- Infrared.ranges(infrared, banks), do: round(range * 1000)
      # No voltage is the greatest range.
      assert thousandths == [800, 1, 2, 3, 4, 5, 6, 7, 12, 13, 14, 15, 8, 9, 10, 11]

      # The angles of section 12.2 of the sheet are those of the profile, pose by pose.
      angles = [
        247.5,
        225,
        202.5,
        180,
        157.5,
        135,
        112.5,
        90,
        -22.5,
        -45,
        -67.5,
        -90,
        67.5,
        45,
        22.5,
        0
      ]

      for {place, pose} <- Enum.zip(Infrared.magellan_order(), Hal.Profile.magellan().irs) do
        angle = Enum.at(angles, place) * :math.pi() / 180
        assert_in_delta Hal.Pose.wrap(pose.heading - angle), 0.0, 1.0e-6
      end
    end

    test "nearer than it can tell, a base bank, a bank too few" do
      banks = [<<201, 100, 100, 100, 100, 100, 100, 100>>, <<100::64>>]
      assert hd(Infrared.ranges(infrared(:metres, 0.1), banks)) == 0.0
      later = %{infrared(:metres) | base: 1, banks: [1], laws: [{4000.0, -2.0}], order: [0]}
      assert Infrared.ranges(later, [<<0::64>>, <<100, 0::56>>]) == [0.4]
      assert Infrared.ranges(later, [<<0::64>>]) == nil
      assert Infrared.ranges(infrared(:metres), [<<0::64>>]) == nil
    end
  end

  describe "bumpers" do
    test "bits: the sheet's examples, each where the sonar of its number looks" do
      segments = Bumpers.default_segments(:bit, 16)
      bumpers = %Bumpers{style: :bit, base: 0x40, count: 16, segments: segments}
      {:ok, bumpers} = Bumpers.report(bumpers, 0x40, 0x05)
      {:ok, bumpers} = Bumpers.report(bumpers, 0x41, 0x80)
      assert Bumpers.pressed(bumpers) == Enum.sort(for k <- [0, 2, 15], do: Enum.at(segments, k))
      assert Bumpers.report(bumpers, 0x42, 0xFF) == :other
      {:ok, bumpers} = Bumpers.report(bumpers, 0x40, 0)
      assert length(Bumpers.pressed(bumpers)) == 1

      for {segment, pose} <- Enum.zip(segments, Hal.Profile.magellan().sonars),
          do: assert_in_delta(Hal.Pose.wrap(segment * :math.pi() / 8 - pose.heading), 0.0, 1.0e-6)
    end

    test "addresses: a panel each, four switches a panel" do
      segments = Bumpers.default_segments(:address, 14)
      bumpers = %Bumpers{style: :address, base: 0x40, count: 14, segments: segments}
      {:ok, bumpers} = Bumpers.report(bumpers, 0x40, 0x08)
      {:ok, bumpers} = Bumpers.report(bumpers, 0x4D, 0x01)
      {:ok, bumpers} = Bumpers.report(bumpers, 0x41, 0xF0)
      assert Bumpers.pressed(bumpers) == [0, List.last(segments)]
      assert Bumpers.report(bumpers, 0x4E, 1) == :other
    end
  end

  test "a stop brakes, however few units a metre has" do
    for distance <- [1.0e-3, 31.387, 31_387.0] do
      {:ok, options} =
        Hal.RFlex.Options.new(port: "/dev/ttyR0", conversions: [distance: distance, angle: 1.0])

      assert [{{:speed, 0}, <<_::binary-6, 0, 0::32, acceleration::32, _::binary>>} | _] =
               Hal.RFlex.Commands.stop(options)

      assert acceleration >= max(distance * options.limits.max_braking - 2, 1)
    end
  end

  describe "queue" do
    test "paced, bounded, the newest of each kind, a stop first" do
      queue = Queue.new(12)
      assert Queue.take(queue, 0) == :empty

      queue =
        Enum.reduce(1..1000, queue, fn n, queue ->
          queue
          |> Queue.put({:speed, 0}, "a#{n}")
          |> Queue.put({:speed, 1}, "b#{n}")
          |> Queue.put(:sonar, "s")
        end)

      assert {:send, "a1000", queue} = Queue.take(queue, 100)
      assert {:wait, 12} = Queue.take(queue, 100)
      assert {:wait, 1} = Queue.take(queue, 111)
      # A newer speed: the axis that has waited goes first, so neither is starved.
      queue = queue |> Queue.put({:speed, 0}, "a1001") |> Queue.put({:speed, 1}, "b1001")
      assert {:send, "b1001", queue} = Queue.take(queue, 112)
      queue = Queue.stop(queue, [{{:speed, 0}, "stop0"}, {{:speed, 1}, "stop1"}])
      assert {:send, "stop0", queue} = Queue.take(queue, 124)
      assert {:send, "stop1", queue} = Queue.take(queue, 136)
      assert {:send, "s", queue} = Queue.take(queue, 148)
      assert Queue.take(queue, 160) == :empty
    end
  end
end
