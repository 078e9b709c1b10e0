defmodule Soak.Junk do
  @moduledoc """
  Datagrams of a stranger who knows no secret: noise, what was recorded, and what was recorded with some bytes
  changed. Pure.
  """

  @doc """
  So many datagrams of a kind; without a record there is only noise.

      iex> Soak.Junk.datagrams(:recorded, 3, 7, ["a"])
      ["a", "a", "a"]
      iex> Soak.Junk.datagrams(:mutated, 2, 7, ["abcdef"]) == Soak.Junk.datagrams(:mutated, 2, 7, ["abcdef"])
      true
  """
  @spec datagrams(:random | :recorded | :mutated, non_neg_integer(), integer(), [binary()]) :: [
          binary()
        ]
  def datagrams(kind, count, seed, recorded) do
    kind = if recorded == [], do: :random, else: kind
    recorded = List.to_tuple(recorded)

    {all, _random} =
      Enum.map_reduce(1..count//1, :rand.seed_s(:exsss, seed), fn _n, random ->
        datagram(kind, recorded, random)
      end)

    all
  end

  defp datagram(:random, _recorded, random) do
    {size, random} = :rand.uniform_s(1_400, random)
    :rand.bytes_s(size, random)
  end

  defp datagram(:recorded, recorded, random) do
    {n, random} = :rand.uniform_s(tuple_size(recorded), random)
    {elem(recorded, n - 1), random}
  end

  defp datagram(:mutated, recorded, random) do
    {datagram, random} = datagram(:recorded, recorded, random)
    {times, random} = :rand.uniform_s(8, random)
    Enum.reduce(1..times, {datagram, random}, fn _n, {bytes, random} -> change(bytes, random) end)
  end

  defp change("", random), do: {"", random}

  defp change(bytes, random) do
    {at, random} = :rand.uniform_s(byte_size(bytes), random)
    {byte, random} = :rand.uniform_s(256, random)
    {how, random} = :rand.uniform_s(3, random)
    <<before::binary-size(at - 1), _old, rest::binary>> = bytes

    case how do
      1 -> {<<before::binary, byte - 1, rest::binary>>, random}
      2 -> {<<before::binary, byte - 1, byte - 1, rest::binary>>, random}
      3 -> {before, random}
    end
  end
end
