defmodule Sim.Emulator.WireTest do
  use ExUnit.Case, async: true
  alias Sim.Emulator.Wire
  doctest Sim.Emulator.Wire

  defp wire(options) do
    {:ok, wire} = Wire.new(options)
    wire
  end

  # All that comes out if bytes are put in one by one.
  defp through(wire, bytes) do
    {taken, _wire} =
      for <<byte <- bytes>>, reduce: {<<>>, wire} do
        {taken, wire} ->
          {out, wire} = wire |> Wire.put(<<byte>>, 0) |> Wire.take(60_000)
          {taken <> out, wire}
      end

    taken
  end

  test "a good wire changes nothing" do
    bytes = :binary.copy("0123456789", 100)
    assert through(wire([]), bytes) == bytes
  end

  test "faults come at their rates; one seed gives the same ones, however the bytes are split" do
    bytes = :binary.copy(<<0>>, 100_000)

    for {fault, expected} <- [
          drop: fn out -> 100_000 - byte_size(out) end,
          double: fn out -> byte_size(out) - 100_000 end,
          flip: fn out -> for(<<bit::1 <- out>>, do: bit) |> Enum.sum() end
        ] do
      {out, _} = wire([{fault, 0.02}, seed: 5]) |> Wire.put(bytes, 0) |> Wire.take(0)
      assert_in_delta expected.(out), 2_000, 200
    end

    some = :crypto.strong_rand_bytes(3_000)
    options = [drop: 0.1, double: 0.1, flip: 0.1]
    {at_once, _} = wire(options) |> Wire.put(some, 0) |> Wire.take(0)
    assert through(wire(options), some) == at_once
    {other, _} = wire([seed: 1] ++ options) |> Wire.put(some, 0) |> Wire.take(0)
    refute other == at_once
    {back, _} = wire([way: 1] ++ options) |> Wire.put(some, 0) |> Wire.take(0)
    refute back == at_once
  end

  test "late bytes keep their order" do
    wire = wire(delay_ms: {0, 40}, seed: 3)
    wire = for k <- 0..50, reduce: wire, do: (wire -> Wire.put(wire, <<k>>, 2 * k))
    {early, wire} = Wire.take(wire, 60)
    assert byte_size(early) in 1..40
    assert Wire.next_ms(wire) > 60
    {late, wire} = Wire.take(wire, 200)
    assert early <> late == :binary.list_to_bin(Enum.to_list(0..50))
    assert Wire.next_ms(wire) == nil
  end

  test "a pulled wire loses what is on it" do
    wire = wire(delay_ms: {10, 10}) |> Wire.put("a", 0) |> Wire.pull() |> Wire.put("b", 1)
    assert {"", wire} = Wire.take(wire, 100)
    assert {"c", _} = wire |> Wire.plug() |> Wire.put("c", 100) |> Wire.take(200)
  end

  test "invalid options are named" do
    for {options, name} <- [
          {[drop: -0.1], "option drop: "},
          {[flip: :nan], "option flip: "},
          {[delay_ms: 5], "option delay_ms: "},
          {[delay_ms: {5, 4}], "option delay_ms: "},
          {[seed: 0.5], "option seed: "},
          {[dorp: 1], "option dorp "},
          {[drop: 0.5, flip: 0.6], "together"}
        ] do
      assert {:error, line} = Wire.new(options)
      assert line =~ name
      refute line =~ "\n"
    end
  end
end
