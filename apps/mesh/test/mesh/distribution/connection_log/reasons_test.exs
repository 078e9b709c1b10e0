defmodule Mesh.Distribution.ConnectionLog.ReasonsTest do
  use ExUnit.Case, async: true
  alias Mesh.Distribution.ConnectionLog
  doctest ConnectionLog.Reasons

  defp alert(code, alerter, reason \\ :undefined, level \\ 2) do
    alert = {:alert, level, code, %{}, :server, reason}
    {:report, %{alert: alert, alerter: alerter, protocol: "TLS", role: :server}}
  end

  test "alerts say who refused whom" do
    seen = {"mag3", {:bad_cert, :unknown_ca}}
    assert {:them, "mag3", why} = ConnectionLog.Reasons.read(alert(48, :own), seen)
    assert why =~ "its certificate is of another fleet"
    assert {:us, nil, why} = ConnectionLog.Reasons.read(alert(48, :peer), {nil, nil})
    assert why =~ "our certificate is of another fleet"

    assert {:them, nil, "it has no certificate"} =
             ConnectionLog.Reasons.read(alert(116, :own), {nil, nil})

    assert {:them, _, why} =
             ConnectionLog.Reasons.read(alert(45, :own), {"mag1", {:bad_cert, :cert_expired}})

    assert why =~ "a clock is wrong (:cert_expired)"
    assert {:them, nil, "TLS alert 99"} = ConnectionLog.Reasons.read(alert(99, :own), {nil, nil})
    assert ConnectionLog.Reasons.read(alert(0, :peer, :undefined, 1), {nil, nil}) == :ignore
  end

  test "all that is no refusal is left alone" do
    for message <- [
          {:string, "hello"},
          {:report, %{label: {:supervisor, :progress}}},
          {:report, [a: 1]},
          {~c"** Something else ~p **", [1]},
          {"binary ~p", [1]},
          {~c"plain", []}
        ],
        do: assert(ConnectionLog.Reasons.read(message, {nil, nil}) == :ignore)

    assert ConnectionLog.Reasons.read(
             {~c"TLS distribution handshake failed: ~p~n", [:x]},
             {nil, nil}
           ) == :known
  end
end
