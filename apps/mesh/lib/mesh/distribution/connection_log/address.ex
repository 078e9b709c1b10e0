defmodule Mesh.Distribution.ConnectionLog.Address do
  @moduledoc false
  # Finds the other end of the connection that this process serves. The socket belongs to this process, or with
  # TLS to one that is linked to it through a few others of the same connection. Named processes belong to all connections
  # and are skipped.
  @hops 3

  @doc "The address and the port of the other side, as `10.0.0.13:53312`; `nil` if it is gone or not known."
  @spec find() :: String.t() | nil
  def find do
    case self() |> ports([], @hops) |> Enum.uniq() do
      [address] -> address
      _none_or_many -> nil
    end
  end

  defp ports(pid, from, hops) do
    case Process.info(pid, [:links, :registered_name]) do
      [links: links, registered_name: name] when name == [] or pid == self() ->
        Enum.flat_map(links -- from, &linked(&1, [pid | from], hops))

      _named_or_gone ->
        []
    end
  end

  defp linked(port, _from, _hops) when is_port(port) do
    case :inet.peername(port) do
      {:ok, {ip, number}} -> ["#{:inet.ntoa(ip)}:#{number}"]
      _no_connection -> []
    end
  end

  defp linked(pid, from, hops) when is_pid(pid) and node(pid) == node() and hops > 0,
    do: ports(pid, from, hops - 1)

  defp linked(_other, _from, _hops), do: []
end
