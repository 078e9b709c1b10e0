defmodule Mesh.Protocol.Beacon do
  @moduledoc false
  # Describes what a node says about itself: the nodes that it hears and their addresses, the nodes that its
  # distribution is connected to, and the port that the distribution listens on (0: ask epmd). Names
  # are text. Pure.

  alias Mesh.Strategy.Static
  alias Mesh.Protocol.WireTerm

  @enforce_keys [:hears, :links, :port]
  defstruct @enforce_keys

  @type t :: %__MODULE__{
          hears: [{String.t(), Mesh.Strategy.address()}],
          links: [String.t()],
          port: 0..65_535
        }

  @most 1_100

  @doc "A beacon as a plain term for the wire."
  @spec term(t()) :: tuple()
  def term(%__MODULE__{} = beacon), do: {beacon.hears, beacon.links, beacon.port}

  @doc """
  A beacon from the wire.

      iex> alias Mesh.Protocol.Beacon
      iex> {:ok, beacon} = Beacon.check({[{"mag1@lab", {{10, 0, 0, 7}, 4370}}], [], 0})
      iex> beacon.hears
      [{"mag1@lab", {{10, 0, 0, 7}, 4370}}]
      iex> Beacon.check({[:mag1], [], 0})
      :error
  """
  @spec check(term()) :: {:ok, t()} | :error
  def check({hears, links, port})
      when is_list(hears) and is_list(links) and port in 0..65_535 do
    if list?(hears, &heard?/1) and list?(links, &name?/1),
      do: {:ok, %__MODULE__{hears: hears, links: links, port: port}},
      else: :error
  end

  def check(_other), do: :error

  @doc """
  The beacon without names that this node does not know, because what it passes on must stay true
  and short.

      iex> alias Mesh.Protocol.Beacon
      iex> beacon = %Beacon{hears: [], links: ["mag1@lab", "x@y"], port: 0}
      iex> Beacon.known(beacon, %{"mag1@lab" => :mag1@lab}).links
      ["mag1@lab"]
  """
  @spec known(t(), %{String.t() => node()}) :: t()
  def known(%__MODULE__{} = beacon, nodes) do
    %{
      beacon
      | hears: Enum.filter(beacon.hears, &is_map_key(nodes, elem(&1, 0))),
        links: Enum.filter(beacon.links, &is_map_key(nodes, &1))
    }
  end

  defp list?(list, fun), do: WireTerm.list?(list, fun) and length(list) <= @most

  defp heard?({name, address}) do
    name?(name) and match?({{_, _, _, _}, _}, address) and Static.address(address) != :error
  end

  defp heard?(_other), do: false
  defp name?(text), do: is_binary(text) and byte_size(text) in 1..255
end
