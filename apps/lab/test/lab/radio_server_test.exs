defmodule Lab.RadioServerTest do
  use ExUnit.Case, async: true
  alias Robot.Names
  alias Lab.RadioServer
  alias Lab.Trial.Options

  defp parts(options) do
    {:ok, options} = options |> Map.new() |> Options.check()
    RadioServer.parts(options)
  end

  test "messages are duplicated and delayed as the options of a run say" do
    assert [part] = parts(duplicates: 1.0, delay_ms: {120, 120}, robots: [:magr1, :magr2])
    air = start_supervised!(part)
    # What it hears of: no heartbeats.
    {{RadioServer, :transmit, [^air, listener]}, ^air} = RadioServer.radio(air, self())
    :ok = Names.register(:magr2, :comms, nil)
    message = Swarm.Message.new(:magr1, :heartbeat, :beat)
    sent_ms = Hal.Clock.now_ms()
    :ok = RadioServer.transmit(air, listener, :magr1, [:magr2], message)
    for _ <- 1..2, do: assert_receive({:"$gen_cast", {:hear, ^message}}, 10_000)
    assert Hal.Clock.now_ms() - sent_ms >= 120
    refute_received {:"$gen_cast", _more}
    assert RadioServer.counts(air) == %{sent: 1, lost: 0}
    refute_received {:sent, _from, _to, _message}
    letter = Swarm.Message.new(:magr1, :round, :letter)
    :ok = RadioServer.transmit(air, listener, :magr1, [:magr2], letter)
    assert_received {:sent, :magr1, [:magr2], ^letter}
  end

  test "a run that asks for nothing has no radio in between" do
    assert parts([]) == []
    assert [_loss] = parts(loss: 0.1)
    assert [_delay] = parts(delay_ms: {0, 0})
    {:ok, options} = Options.check([])
    assert [_a_script] = RadioServer.parts(options, true)
  end
end
