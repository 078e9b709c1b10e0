defmodule Hal.RFlex.OptionsTest do
  use ExUnit.Case, async: true
  alias Hal.RFlex.{Driver, Options}
  doctest Hal.RFlex.Options

  @port [port: "/dev/ttyR0"]

  test "a Magellan and an ATRV mini need nothing but a port" do
    assert {:ok, options} = Driver.options(@port)
    assert options.sonar_banks == [8, 8] and options.ir_banks == [8, 8]
    assert options.bumpers.count == 16 and options.sonar_times == {30_000, 1250, 0}
    assert options.limits.max_linear == 0.5 and options.limits.max_braking == 1.0
    assert {:ok, options} = Driver.options(@port ++ [profile: :atrv_mini])
    assert options.ir_banks == [] and options.sonar_times == {30_000, 0, 0}
    assert options.limits.max_turn == 0.8
    assert {:ok, _} = Driver.options(serial: [pty: "/tmp/line"])
  end

  test "every wrong option is one line that names it and what is allowed" do
    wrong = [
      port: 5,
      speed: 0,
      speed: :fast,
      serial: [bits: 7],
      serial: [keep_alive_ms: 301],
      serial: [keep_alive_ms: 99],
      serial: [keep_alive_ms: :infinity],
      serial: :none,
      profile: :roomba,
      conversions: [distance: 0],
      conversions: [distance: 1.0e308],
      conversions: [angle: "x"],
      conversions: [range: -1474],
      conversions: [ir_a: []],
      conversions: [ir_a: [1.0], ir_b: -2.0],
      conversions: [ir_b: 1.0e9],
      conversions: [length: 5],
      conversions: 5,
      conversions: [distance: 5, distance: 6],
      limits: [max_linear: 0],
      limits: [max_linear: 0.6],
      limits: [max_turn: 1.0e300],
      limits: [max_braking: 11],
      limits: [max_height: 1],
      bumpers: [style: :byte],
      bumpers: [base: 256],
      bumpers: [count: -1],
      bumpers: [count: 8, segments: [1, 2]],
      bumpers: [segments: [16]],
      sonar_banks: [17],
      sonar_banks: [8, :eight],
      sonar_stride: 0,
      sonar_age: 0,
      sonar_times: {30_000, 0},
      sonar_times: {0, 0, 0},
      ir_banks: [9],
      ir_base_bank: 8,
      ir_order: [0, 0],
      ir_law: :inches,
      ir_min: -1,
      power_offset: 1.0e308,
      joystick: 1,
      joystick_ratios: {6, -0.01},
      joystick_ratios: 0.006,
      home: 256,
      report_period: 0,
      pace_ms: 0,
      clock: :now,
      colour: :red
    ]

    for {key, value} <- wrong do
      assert {:error, line} = Options.new(Keyword.put(@port, key, value)), inspect({key, value})
      assert line =~ to_string(key), line
      refute line =~ "\n"
    end

    assert {:error, _} = Options.new([])
    assert {:error, _} = Options.new(:port)
    assert {:error, line} = Options.new(@port ++ [profile: :magellan, sonar_banks: [8]])
    assert line =~ "16 together"
  end
end
