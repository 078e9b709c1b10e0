defmodule Mesh.Protocol.Namesake do
  @moduledoc false
  # Decides when another node of this node's name is told of: when it is heard first, from an address that was not told yet,
  # and every five minutes; and once when it has not been heard for 10 s. It speaks once a second, and a computer with several
  # cards from several addresses. Pure; times are in ms.

  @gone_ms 10_000
  @again_ms 300_000
  @most 8

  defstruct addresses: [], heard_ms: nil, told_ms: nil

  @typedoc "`addresses` are those that were told, newest first."
  @type t :: %__MODULE__{
          addresses: [:inet.ip4_address()],
          heard_ms: integer() | nil,
          told_ms: integer() | nil
        }

  @doc """
  It was heard from there; returns whether to tell.

      iex> alias Mesh.Protocol.Namesake
      iex> {true, other} = Namesake.hear(%Namesake{}, {10, 0, 0, 9}, 0)
      iex> {false, other} = Namesake.hear(other, {10, 0, 0, 9}, 1_000)
      iex> {false, other} = Namesake.tick(other, 10_999)
      iex> {true, other} = Namesake.tick(other, 11_000)
      iex> Namesake.tick(other, 60_000)
      {false, other}
  """
  @spec hear(t(), :inet.ip4_address(), integer()) :: {tell? :: boolean(), t()}
  def hear(%__MODULE__{} = other, address, now_ms) do
    other = %{other | heard_ms: now_ms}

    cond do
      address not in other.addresses and length(other.addresses) < @most ->
        {true, %{other | addresses: [address | other.addresses], told_ms: now_ms}}

      now_ms - other.told_ms >= @again_ms ->
        {true, %{other | told_ms: now_ms}}

      true ->
        {false, other}
    end
  end

  @doc "Time; returns whether to tell that there is none any more."
  @spec tick(t(), integer()) :: {tell? :: boolean(), t()}
  def tick(%__MODULE__{heard_ms: heard_ms}, now_ms)
      when heard_ms != nil and now_ms - heard_ms >= @gone_ms,
      do: {true, %__MODULE__{}}

  def tick(other, _now_ms), do: {false, other}
end
