defmodule Mesh.Distribution.Access.Networks do
  @moduledoc false
  # Reads IPv4 networks as an operator writes them, `"10.0.0.20"` or `"10.0.1.0/24"`, and decides whether an address is in
  # one. Pure.
  import Bitwise

  @typedoc "The first bits of an address that decide, as a number, and the mask that takes them from an address."
  @type t :: {bits :: non_neg_integer(), mask :: non_neg_integer()}

  @all 0xFFFFFFFF

  @doc """
  Reads a network: an address, as text or as a tuple, or text of an address and the number of its bits that count.
  Bits behind those must be zero, so that `10.0.1.7/24` is an error and not all of `10.0.1.0/24`.

      iex> alias Mesh.Distribution.Access.Networks
      iex> {:ok, network} = Networks.read("10.0.1.0/24")
      iex> for ip <- [{10, 0, 1, 77}, {10, 0, 2, 77}], do: Networks.find([network], ip)
      [network, nil]
      iex> for text <- ["10.0.1.7/24", "10.0.1.0/33", "robots", {10, 0, 0, 256}], do: Networks.read(text)
      [:error, :error, :error, :error]
  """
  @spec read(term()) :: {:ok, t()} | :error
  def read({a, b, c, d} = ip) when a in 0..255 and b in 0..255 and c in 0..255 and d in 0..255,
    do: {:ok, {number(ip), @all}}

  def read(text) when is_binary(text) and byte_size(text) <= 18 do
    with [address | bits] <- String.split(text, "/", parts: 2),
         {:ok, ip} <- :inet.parse_ipv4strict_address(String.to_charlist(address)),
         {:ok, prefix} <- prefix(bits),
         mask = @all - (@all >>> prefix),
         bits when (bits &&& mask) == bits <- number(ip) do
      {:ok, {bits, mask}}
    else
      _not_a_network -> :error
    end
  end

  def read(_other), do: :error

  @doc "The first of the networks that the address is in, or `nil`."
  @spec find([t()], :inet.ip_address()) :: t() | nil
  def find(networks, {_, _, _, _} = ip) do
    number = number(ip)
    Enum.find(networks, fn {bits, mask} -> (number &&& mask) == bits end)
  end

  def find(_networks, _ipv6), do: nil

  defp prefix([]), do: {:ok, 32}

  defp prefix([text]) do
    case Integer.parse(text) do
      {bits, ""} when bits in 0..32 -> {:ok, bits}
      _other -> :error
    end
  end

  defp number({a, b, c, d}), do: a <<< 24 ||| b <<< 16 ||| c <<< 8 ||| d
end
