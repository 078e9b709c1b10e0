defmodule Mesh.Distribution.Access.Refusals do
  @moduledoc """
  Counts the distribution connections that were refused, and logs the first of each address in a minute:

      refused a node at 10.0.0.66: not an address of the fleet (12604 more attempts since the last such line)

  with the event `[:mesh, :refused]`. At most 20 addresses are logged in a minute; those of others are only counted. So
  a flood costs a counter for each attempt, and neither memory nor disk.
  """
  require Logger
  alias Mesh.Distribution
  alias Hal.Event
  alias Mesh.SafeTable

  @table __MODULE__
  @minute_ms 60_000
  @lines 20
  @reasons [:stranger, :too_often, :new_names, :elsewhere]

  @doc "Creates the table; the calling process owns it."
  @spec open() :: :ok
  def open do
    if :ets.whereis(@table) != :undefined, do: :ets.delete(@table)
    @table = :ets.new(@table, [:named_table, :public])
    true = :ets.insert(@table, for(why <- @reasons, do: {why, 0}))
    :ok
  end

  @doc "How many were refused since the node was started, by reason; empty for a node that refuses none."
  @spec counts() :: %{Distribution.Access.refusal() => non_neg_integer()}
  def counts do
    for why <- @reasons,
        [{^why, count}] <- [SafeTable.lookup(@table, why)],
        into: %{},
        do: {why, count}
  end

  @doc "Notes a refusal."
  @spec note(:inet.ip_address(), Distribution.Access.refusal(), integer()) :: :ok
  def note(ip, why, now_ms) do
    _count = :ets.update_counter(@table, why, 1)

    case :ets.lookup(@table, {:address, ip}) do
      [{key, since_ms, _count}] when now_ms - since_ms < @minute_ms ->
        _count = :ets.update_counter(@table, key, {3, 1}, {key, now_ms, 0})
        :ok

      [{_key, _since_ms, count}] ->
        log(ip, why, count, now_ms)

      [] ->
        if room?(now_ms), do: log(ip, why, 0, now_ms), else: :ok
    end
  end

  # Addresses of earlier minutes make room.
  defp room?(now_ms) do
    since = {{{:address, :_}, :"$1", :_}, [{:<, :"$1", now_ms - @minute_ms}], [true]}
    full? = :ets.info(@table, :size) >= @lines + length(@reasons)
    not full? or :ets.select_delete(@table, [since]) > 0
  end

  defp log(ip, why, before, now_ms) do
    :ets.insert(@table, {{:address, ip}, now_ms, 0})
    # A handler of the event, or a console that is stopped, must not keep others waiting.
    _pid = spawn(fn -> say(:inet.ntoa(ip), why, before, now_ms) end)
    :ok
  end

  defp say(address, why, before, now_ms) do
    about = %{refused: :them, who: nil, address: "#{address}", why: why(why)}
    Event.execute([:mesh, :refused], %{at_ms: now_ms}, about)
    Logger.warning("refused a node at #{address}: #{why(why)}#{before(before)}")
  end

  defp why(:stranger), do: "not an address of the fleet"
  defp why(:elsewhere), do: "it called another address than that of the interface of this node"
  defp why(:too_often), do: "it calls too often"
  defp why(:new_names), do: "it calls by too many names that are not known"

  defp before(0), do: ""
  defp before(count), do: " (#{count} more attempts since the last such line)"
end
