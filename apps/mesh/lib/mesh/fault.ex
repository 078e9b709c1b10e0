defmodule Mesh.Fault do
  @moduledoc """
  Decides when a fault of the network is told: once it has lasted for 3 s, and once for as long as it is the same one. Pure;
  times are in ms.
  """

  @lasting_ms 3_000

  defstruct line: nil, since_ms: 0, told: nil

  @typedoc "`line` is what is wrong now, `told` what people were told."
  @type t :: %__MODULE__{line: String.t() | nil, since_ms: integer(), told: String.t() | nil}

  @doc """
  Time: what is wrong now, or `nil`. The news is `{:fault, line}`, `:healed`, or none.

      iex> alias Mesh.Fault
      iex> {fault, nil} = Fault.tick(%Fault{}, "eth0 is not connected", 1_000)
      iex> {fault, nil} = Fault.tick(fault, "eth0 is not connected", 3_999)
      iex> {fault, {:fault, "eth0 is not connected"}} = Fault.tick(fault, "eth0 is not connected", 4_000)
      iex> {fault, nil} = Fault.tick(fault, "eth0 is not connected", 60_000)
      iex> {%{told: nil}, :healed} = Fault.tick(fault, nil, 60_200)
  """
  @spec tick(t(), String.t() | nil, integer()) :: {t(), {:fault, String.t()} | :healed | nil}
  def tick(%{told: nil} = fault, nil, _now_ms), do: {%{fault | line: nil}, nil}
  def tick(_fault, nil, _now_ms), do: {%__MODULE__{}, :healed}

  def tick(%{line: line, since_ms: since_ms, told: told} = fault, line, now_ms) do
    if line != told and now_ms - since_ms >= @lasting_ms,
      do: {%{fault | told: line}, {:fault, line}},
      else: {fault, nil}
  end

  def tick(fault, line, now_ms), do: {%{fault | line: line, since_ms: now_ms}, nil}
end
