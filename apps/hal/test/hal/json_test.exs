defmodule Hal.JsonTest do
  use ExUnit.Case, async: true
  doctest Hal.Json

  test "keys are sorted as text, whatever they are" do
    assert Hal.Json.encode!(%{"b" => 1, :a => 2, "c" => 3}) == ~S({"a":2,"b":1,"c":3})
  end

  test "an object pair inside a list is an object, an ordered object may be empty" do
    assert Hal.Json.encode!([{:object, [{"a", 1}]}, {:object, []}]) == ~S([{"a":1},{}])
    assert Hal.Json.encode!([]) == "[]"
    assert Hal.Json.encode!(%{}) == "{}"
  end

  test "control characters and quotes are escaped, other letters stay" do
    assert Hal.Json.encode!("a\"b\\c\t\u0001é😀") == ~S("a\"b\\c\t\u0001é😀")
  end

  test "floats read back as the same number" do
    for _ <- 1..500 do
      number = :rand.normal() * :math.pow(10.0, :rand.uniform(40) - 20)
      assert number |> Hal.Json.encode!() |> String.to_float() == number
    end
  end

  test "what has no form is named" do
    assert_raise ArgumentError, ~r/no JSON form: {1, 2}/, fn -> Hal.Json.encode!({1, 2}) end
    assert_raise ArgumentError, ~r/not UTF-8/, fn -> Hal.Json.encode!(<<255>>) end
    assert_raise ArgumentError, ~r/no JSON key/, fn -> Hal.Json.encode!(%{1 => 2}) end
  end
end
