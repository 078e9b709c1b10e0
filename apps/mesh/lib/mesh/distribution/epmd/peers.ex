defmodule Mesh.Distribution.Epmd.Peers do
  @moduledoc false
  # Computes the port of a name, and the addresses of the nodes of a list. Pure.
  #
  # Robots with the usual names have a port each, so that those on one machine do not collide:
  # `mag1` to `mag100` 9101 to 9200, `min1` to `min100` 9201 to 9300, `world` 9301, `base` 9302,
  # `demo`
  # 9303. Other names share 9400 to 9999.

  @usual %{"world" => 9_301, "base" => 9_302, "demo" => 9_303}
  @numbered [{"mag", 9_100}, {"min", 9_200}]

  @type peer :: {node :: String.t(), :inet.ip_address(), :inet.port_number()}

  @doc """
  Reads a list of nodes; a node without a port has its default one. Invalid entries are left out.

      iex> Mesh.Distribution.Epmd.Peers.parse("mag2@convoy=10.0.0.12:9400, min1@convoy=[fe80::1], nonsense")
      [{"mag2@convoy", {10, 0, 0, 12}, 9400}, {"min1@convoy", {65152, 0, 0, 0, 0, 0, 0, 1}, 9201}]
  """
  @spec parse(String.t()) :: [peer()]
  def parse(text) do
    for entry <- String.split(text, [",", " ", "\n"], trim: true),
        [node, place] <- [String.split(entry, "=")],
        [name, _host] <- [String.split(node, "@")],
        {ip, port} <- List.wrap(place(place, name)),
        do: {node, ip, port}
  end

  @doc "The port of a robot without a configured one."
  @spec default_port(String.t()) :: 9_101..9_999
  def default_port(name), do: @usual[name] || numbered(name) || shared(name)

  @doc """
  The port that a node of this name listens on; 0 means any, for shells (`rem-…`, `rpc-…`), which
  no node dials and which share the environment of a robot.

      iex> Mesh.Distribution.Epmd.Peers.own_port("mag1", %{"CONVOY_DIST_PORT" => "9400", "ROBOT" => "mag1"})
      9400
      iex> Mesh.Distribution.Epmd.Peers.own_port("rem-1", %{"CONVOY_DIST_PORT" => "9400", "ROBOT" => "mag1"})
      0
  """
  @spec own_port(String.t(), %{optional(String.t()) => String.t()}) :: :inet.port_number()
  def own_port(name, environment) do
    named = Map.get(environment, "ROBOT", name)

    case {name, Integer.parse(Map.get(environment, "CONVOY_DIST_PORT", ""))} do
      {^named, {port, ""}} when port in 1..65_535 -> port
      {^named, _none} -> if shell?(name), do: 0, else: default_port(name)
      {_other, _port} -> 0
    end
  end

  @doc "The probable address of a node that was not heard, or `nil`."
  @spec guess(name :: String.t(), host :: String.t(), own_host :: String.t()) ::
          {:inet.ip_address(), :inet.port_number()} | nil
  def guess(name, host, host), do: {{127, 0, 0, 1}, default_port(name)}

  def guess(name, host, _own_host) do
    case :inet.parse_strict_address(String.to_charlist(host)) do
      {:ok, ip} -> {ip, default_port(name)}
      {:error, _no_address} -> nil
    end
  end

  # The names that Elixir's releases and shells give themselves.
  defp shell?(name), do: String.starts_with?(name, ["rem-", "rpc-", "undefined"])

  defp numbered(name) do
    Enum.find_value(@numbered, fn {kind, base} ->
      with true <- String.starts_with?(name, kind),
           {number, ""} when number in 1..100 <-
             name |> String.replace_prefix(kind, "") |> Integer.parse(),
           do: base + number,
           else: (_other -> nil)
    end)
  end

  defp shared(name), do: 9_400 + rem(:erlang.crc32(name), 600)

  defp place("[" <> rest, name) do
    case String.split(rest, "]") do
      [ip, ""] -> address(ip, default_port(name))
      [ip, ":" <> port] -> address(ip, port)
      _other -> nil
    end
  end

  defp place(text, name) do
    case String.split(text, ":") do
      [ip] -> address(ip, default_port(name))
      [ip, port] -> address(ip, port)
      _other -> nil
    end
  end

  defp address(ip, port) when is_binary(port) do
    case Integer.parse(port) do
      {port, ""} when port in 1..65_535 -> address(ip, port)
      _other -> nil
    end
  end

  defp address(ip, port) do
    case :inet.parse_strict_address(String.to_charlist(ip)) do
      {:ok, ip} -> {ip, port}
      {:error, _no_address} -> nil
    end
  end
end
