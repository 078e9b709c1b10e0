defmodule Bench.PageTest do
  use ExUnit.Case, async: false
  import ExUnit.CaptureIO
  @moduletag :slow
  @moduletag :realtime
  @moduletag :capture_log
  @moduletag skip:
               (case Application.ensure_all_started(:mochiweb) do
                  {:ok, _apps} -> nil
                  _absent -> "erlang-mochiweb is not installed"
                end)
  doctest Bench.Page

  test "each kind of browser has a row, and no robot misses its ticks for those that read nothing" do
    line = ~w(--robots 2 --clients 2 --slow 5 --seconds 1 --rounds 1)
    text = capture_io(fn -> assert :ok = Bench.Page.Main.run(line) end)

    for who <- ~w(nobody readers deaf) do
      assert [hz] =
               Regex.run(~r/^\| #{who} \| .* \| ([\d.]+) Hz \| \d+ ms \|$/m, text,
                 capture: :all_but_first
               )

      assert String.to_float(hz) > 8.0
    end
  end

  test "wrong input is one line each" do
    assert {:error, [robots, slow]} = Bench.Page.Main.run(~w(--robots 0 --slow x))
    assert robots =~ ~s(--robots: expected a whole number from 1 to 100)
    assert slow =~ ~r/--slow: expected .*, got "x"/
  end
end
