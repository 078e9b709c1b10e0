defmodule Mesh.Distribution.ConnectionLog do
  @moduledoc """
  Logs in one line which connection was refused, from where, and why. Erlang reports this in
  several ways, some over many lines, none with an address; this filter of the logger turns them
  into

      refused mag3 at 10.0.0.13:53312: its certificate is of another fleet (unknown CA)

  and the event `[:mesh, :refused]`. The filter runs in the process that reports, which holds the
  connection, so the address is known there; or it was when the certificate came (`Peer`), if the
  other side has hung up since. At most five lines a second are logged, so that
  connection attempts cannot fill a disk; the events of the others are dropped with them.

  A node without TLS that is called by one with TLS hangs up silently; the caller logs it.
  """
  alias Hal.Event
  alias Mesh.Distribution.ConnectionLog
  alias Mesh.Distribution.ConnectionLog.{Address, Peer}

  @per_second 5

  @doc "Puts the filter before all handlers of the logger. Repeated calls change nothing."
  @spec install() :: :ok
  def install do
    state = :atomics.new(2, [])
    _ = :logger.add_primary_filter(__MODULE__, {&__MODULE__.filter/2, state})
    :ok
  end

  @doc false
  @spec filter(:logger.log_event(), :atomics.atomics_ref()) :: :logger.filter_return()
  def filter(%{msg: message} = event, state) do
    case ConnectionLog.Reasons.read(message, Peer.seen()) do
      :ignore -> :ignore
      :known -> :stop
      refusal -> if room?(state), do: say(event, refusal), else: :stop
    end
  end

  defp say(event, {whom, who, why}) do
    address = Address.find() || Peer.address()
    now = System.monotonic_time(:millisecond)
    about = %{refused: whom, who: who, address: address, why: why}
    Event.execute([:mesh, :refused], %{at_ms: now}, about)
    place = "#{who || "a node"} at #{address || "an unknown address"}"
    line = if whom == :us, do: "#{place} refused us: #{why}", else: "refused #{place}: #{why}"

    %{
      event
      | level: :warning,
        msg: {:string, line},
        meta: Map.take(event.meta, [:time, :gl, :pid])
    }
  end

  # The current second, and how many lines were logged in it.
  defp room?(state) do
    second = System.monotonic_time(:second)
    if :atomics.exchange(state, 1, second) != second, do: :atomics.put(state, 2, 0)
    :atomics.add_get(state, 2, 1) <= @per_second
  end
end
