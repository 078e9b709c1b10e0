defmodule Hal.TickerTest do
  use ExUnit.Case, async: true
  alias Hal.Ticker
  doctest Ticker

  test "keeps to its times, however late it is asked for the next" do
    ticker = Ticker.start(:tick, 20, 0)
    first_ms = ticker.due_ms
    assert_receive :tick
    refute_received :tick
    assert Ticker.next(ticker).due_ms - first_ms >= 20
    assert_receive :tick
  end

  test "does not make up for what was missed" do
    now_ms = System.monotonic_time(:millisecond)
    late = %Ticker{message: :tick, period_ms: 20, due_ms: now_ms - 10_000}
    ticker = Ticker.next(late)
    assert ticker.due_ms >= now_ms
    assert_receive :tick
    refute_received :tick
  end

  test "ticks that somebody else sent neither double the pace nor hold it up" do
    ticker = Ticker.start(:tick, 50, 50)
    ticker = Enum.reduce(1..1_000, ticker, fn _forged, ticker -> Ticker.next(ticker) end)
    assert ticker.due_ms - System.monotonic_time(:millisecond) <= 50
    assert_receive :tick
    refute_receive :tick, 100
  end

  test "where somebody else sets the pace, nothing comes" do
    assert Ticker.next(nil) == nil
  end
end
