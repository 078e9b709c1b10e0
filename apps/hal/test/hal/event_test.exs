defmodule Hal.EventTest do
  use ExUnit.Case, async: true
  import ExUnit.CaptureLog
  alias Hal.Event
  doctest Hal.Event

  defp attach(id, event, function) do
    :ok = Event.attach(id, event, function, self())
    on_exit(fn -> Event.detach(id) end)
  end

  test "all handlers of an event hear it, and no others" do
    tell = fn event, measurements, metadata, test ->
      send(test, {event, measurements, metadata})
    end

    attach({:a, self()}, [:event_test, :one], tell)
    attach({:b, self()}, [:event_test, :one], tell)
    attach({:c, self()}, [:event_test, :two], tell)

    Event.execute([:event_test, :one], %{n: 1}, %{robot: :mag1})
    assert_received {[:event_test, :one], %{n: 1}, %{robot: :mag1}}
    assert_received {[:event_test, :one], %{n: 1}, %{robot: :mag1}}
    refute_received {_, _, _}
  end

  test "a handler that fails is detached and reported; the others still hear" do
    attach({:good, self()}, [:event_test, :bad], fn _, _, _, test -> send(test, :heard) end)
    attach({:bad, self()}, [:event_test, :bad], fn _, _, _, _ -> throw(:oops) end)
    me = self()

    attach({:failure, self()}, [:hal, :event, :failure], fn _, _, metadata, test ->
      if metadata.handler == {:bad, me}, do: send(test, {metadata.kind, metadata.reason})
    end)

    log = capture_log(fn -> assert Event.execute([:event_test, :bad], %{}) == :ok end)
    assert log =~ "detached"
    assert_received :heard
    assert_received {:throw, :oops}
    assert Event.detach({:bad, self()}) == {:error, :not_found}
  end
end
