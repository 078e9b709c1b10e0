defmodule Hal.OptionsTest do
  use ExUnit.Case, async: true
  alias Hal.Options
  alias Hal.Options.Type
  doctest Hal.Options
  doctest Hal.Options.Type
  doctest Hal.Options.Wording

  @table [
    port: [:path, required: true],
    baud: [{:integer, 1, 9_600, "baud"}, default: 300],
    limits: {:keys, turn: {:number, 0.0, 1.0, "rad/s"}},
    banks: {:list, {:integer, 0, 16}, 2},
    style: {:one_of, [:bit, :address]},
    pace: {:or, :off, {:tuple, [{:integer, 1, 50}, :boolean], "{ms, true}"}},
    lens: [{:check, &__MODULE__.even?/1, "an even number"}, default: nil],
    clock: :mfa,
    name: {:text, "a name"},
    delay_ms: {:span, 0, 500, "whole ms"},
    seed: :integer,
    address: :ipv4
  ]

  def even?(n), do: is_integer(n) and rem(n, 2) == 0

  test "all that is allowed is taken" do
    options = [
      pace: {3, true},
      port: "/dev/a",
      limits: [turn: 1],
      banks: [16, 0],
      style: :bit,
      lens: nil,
      delay_ms: {0, 500},
      seed: -7,
      clock: {System, :monotonic_time, []}
    ]

    assert {:ok, checked} = Options.check(options, @table, "test")
    assert checked[:limits] == [turn: 1.0] and checked[:baud] == 300 and checked[:lens] == nil
    assert {:ok, _} = Options.check([port: "a", pace: :off, lens: 2], @table, "test")
  end

  test "what is wrong is one line with the key, the value and what is allowed" do
    wrong = [
      {[port: "a\0b"], "port: expected a path, got <<97, 0, 98>>"},
      {[port: ""], ~s|port: expected a path, got ""|},
      {[name: "a\nb"], ~S|name: expected a name, got "a\nb"|},
      {[name: <<0xFF>>], "name: expected a name, got <<255>>"},
      {[port: nil], "port: expected a path, got nil"},
      {[baud: 1.0], "baud: expected a whole number from 1 to 9600 baud, got 1.0"},
      {[baud: Integer.pow(10, 400)], ~r/baud: expected .*, got 1000/},
      {[limits: [turn: 1.0e308]],
       "limits.turn: expected a number from 0.0 to 1.0 rad/s, got 1.0e308"},
      {[limits: [turn: :nan]], ~r/limits\.turn: expected .*, got :nan/},
      {[limits: [trun: 1]], "limits.trun is not known: allowed are turn; did you mean turn?"},
      {[limits: 5], "limits: expected [key: value, …] with turn, got 5"},
      {[banks: [17]], ~r/banks\.1: expected a whole number from 0 to 16.*, got 17/},
      {[banks: [1, 2, 3]], ~r/banks: expected a list of up to 2.*, got \[1, 2, 3\]/},
      {[banks: [1 | 2]], ~r/banks: expected a list of up to 2.*, got \[1 \| 2\]/},
      {[style: "bit"], ~s|style: expected :bit or :address, got "bit"; did you mean :bit?|},
      {[pace: {0, true}], ~r/pace: expected a whole number from 1 to 50.*, got 0/},
      {[pace: 7], "pace: expected :off or {ms, true}, got 7"},
      {[lens: 3], "lens: expected an even number, got 3"},
      {[delay_ms: {5, 4}],
       "delay_ms: expected {least, most}, whole ms from 0 to 500, got {5, 4}"},
      {[address: <<0xFF>>], "address: expected an IPv4 address such as"},
      {[address: "10.0.0.256"],
       ~s|address: expected an IPv4 address such as "10.0.0.7", got "10.0.0.256"|},
      {[address: {1, 2, 3}], ~r/address: expected an IPv4 address .*, got \{1, 2, 3\}/},
      {[seed: 1.0], "seed: expected a whole number, got 1.0"},
      {[clock: :now], "clock: expected {module, function, arguments}"},
      {[name: String.duplicate("x", 256)], "expected a name"},
      {[name: "a", name: "b"], "name is given twice"},
      {[{"nobody's option", 1}], "nobody's option is not known: allowed are port, baud"}
    ]

    for {options, words} <- wrong do
      options = Enum.uniq_by(options ++ [port: "a"], fn {k, v} -> {k, k == :name && v} end)
      assert {:error, line} = Options.check(options, @table, "test")
      assert line =~ words and line =~ "test option "
      refute line =~ "\n"
      assert String.length(line) < 300
      assert_raise ArgumentError, line, fn -> Options.check!(options, @table, "test") end
    end

    for options <- [:port, nil, [:port], [{1, 2}], [{:port, "a"} | 3], %{port: "a"}] do
      assert {:error, "test options: expected " <> _} = Options.check(options, @table, "test")
    end
  end

  test "keys and values of any length make a short line" do
    long = String.duplicate("a", 1_000_000)

    for options <- [[{long, 1}], [{"a\n" <> long, 1}], [{<<0xFF>> <> long, 1}], [port: [long]]] do
      assert {:error, line} = Options.check(options, @table, "test")
      assert String.length(line) < 400
      refute line =~ "\n"
    end
  end

  test "no atom is made of a key" do
    keys = for n <- 1..100, do: "no such key #{n}"
    for key <- keys, do: Type.read({:keys, @table}, [{key, 1}])
    for key <- keys, do: assert_raise(ArgumentError, fn -> String.to_existing_atom(key) end)
  end
end
