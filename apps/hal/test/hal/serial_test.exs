defmodule Hal.SerialTest do
  use ExUnit.Case, async: true
  doctest Hal.Serial
  alias Hal.Serial

  test "options are checked before anything is opened, in one line" do
    long = String.duplicate("x", 5000)

    wrong = [
      {[], "option port is missing"},
      {[port: ""], ~r/option port: expected .*, got ""/},
      {[port: nil, speed: 9600], ~r/option port: expected .*, got nil/},
      {[port: "a\0b"], "expected a path"},
      {[port: long], "expected a path"},
      {[port: :ttyS0], "expected a path"},
      {[port: "a", pty: "b"], "option pty: expected either port or pty, got \"b\""},
      {[port: "a", speed: -5], "1 to 20000000"},
      {[port: "a", speed: 9600.0], "1 to 20000000"},
      {[port: "a", speed: 1.0e308], "1 to 20000000"},
      {[port: "a", speed: Integer.pow(10, 400)], "1 to 20000000"},
      {[port: "a", last_words: long], "at most 1024 bytes"},
      {[port: "a", last_words: ~c"ab"], "at most 1024 bytes"},
      {[port: "a", keep_alive_ms: 9], "10 to 60000"},
      {[port: "a", keep_alive_ms: :infinity], "10 to 60000"},
      {[port: "a", module: Enum], "Hal.Serial.Native"},
      {[port: "a", module: No.Such], "Hal.Serial.Native"},
      {[port: "a", parity: :even], "option parity is not known: allowed are port"},
      {[{1, "a"}], "[key: value, …] with port"},
      {:port, "[key: value, …] with port"}
    ]

    for {options, words} <- wrong do
      assert {:error, line} = Serial.options(options)
      assert line =~ words
      assert byte_size(line) < 300 and not (line =~ "\n"), line
      assert_raise ArgumentError, line, fn -> Serial.open(options) end
    end
  end

  test "errors are one line, which says what to do where something can be done" do
    reasons =
      ~w(enoent eacces ebusy eio enodev enxio enotty einval eexist speed unplugged terminated overrun closed timeout)a

    for reason <- reasons ++ [{:exit, 137}, {:os, "Too many open files"}, :whatever] do
      assert "/dev/ttyR0: " <> words = Serial.explain(reason, "/dev/ttyR0")
      assert words != "" and not (words =~ "\n")
    end

    assert Serial.explain(:eacces, "/dev/ttyR0") =~ "group dialout"
  end
end
