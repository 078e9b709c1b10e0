defmodule Mesh.Strategy.Static do
  @moduledoc false
  # Sends beacons to a list of addresses, for networks that block multicast. Addresses that are not
  # heard are retried for ever, at intervals that grow to 5 s. One address that is up is enough: its
  # beacons report the others. Its option is the list, of `{{10, 0, 0, 7}, 4370}` or
  # `"10.0.0.7:4370"`.
  @behaviour Mesh.Strategy
  alias Hal.Options.Wording
  alias Mesh.Backoff

  @most 1_000

  @impl Mesh.Strategy
  def init(addresses) when is_list(addresses) and length(addresses) <= @most do
    Enum.reduce_while(addresses, {:ok, []}, fn text, {:ok, state} ->
      case address(text) do
        {:ok, address} -> {:cont, {:ok, state ++ [{address, nil}]}}
        :error -> {:halt, {:error, line(text)}}
      end
    end)
  end

  def init(other), do: {:error, line(other)}

  @impl Mesh.Strategy
  def targets(state, known, now_ms, chance) do
    {targets, rows} =
      for {{address, backoff}, turn} <- Enum.with_index(state) do
        backoff = backoff || Backoff.new(now_ms)
        probe(address, backoff, address in known, now_ms, spread(chance, turn))
      end
      |> Enum.unzip()

    {Enum.concat(targets), rows}
  end

  @doc """
  Parses an address as people write it.

      iex> Mesh.Strategy.Static.address("10.0.0.7:4370")
      {:ok, {{10, 0, 0, 7}, 4370}}
  """
  @spec address(term()) :: {:ok, Mesh.Strategy.address()} | :error
  def address({{a, b, c, d}, port} = address)
      when a in 0..255 and b in 0..255 and c in 0..255 and d in 0..255 and port in 1..65_535,
      do: {:ok, address}

  def address(text) when is_binary(text) do
    with [ip, port] <- String.split(text, ":"),
         {:ok, ip} <- :inet.parse_ipv4strict_address(:binary.bin_to_list(ip)),
         {port, ""} when port in 1..65_535 <- Integer.parse(port) do
      {:ok, {ip, port}}
    else
      _no_address -> :error
    end
  end

  def address(_other), do: :error

  defp probe(address, _backoff, true, now_ms, _chance), do: {[], {address, Backoff.new(now_ms)}}

  defp probe(address, backoff, false, now_ms, chance) do
    if Backoff.due?(backoff, now_ms),
      do: {[address], {address, Backoff.tried(backoff, now_ms, chance)}},
      else: {[], {address, backoff}}
  end

  # One random number for all, a different part of it for each.
  defp spread(chance, turn), do: :math.fmod(chance + turn * 0.618, 1.0)

  defp line(wrong) do
    {:error, [{[], text}]} = Wording.refuse(~s(an address such as "10.0.0.7:4370" (UDP\)), wrong)
    "peers: #{text}"
  end
end
