defmodule Mesh.Protocol.Beacon do
  @moduledoc """
  What a node says about itself: the sessions that it knows (so that listeners can tell that it
  speaks now), the nodes that it hears and their addresses, the nodes that its distribution is
  connected to, and the port that the distribution listens on (0: ask epmd). Names are text. Pure.
  """

  alias Mesh.Strategy.Static
  alias Mesh.Protocol.WireTerm

  @enforce_keys [:sessions, :hears, :links, :port]
  defstruct @enforce_keys

  @type t :: %__MODULE__{
          sessions: [{String.t(), non_neg_integer()}],
          hears: [{String.t(), Mesh.Strategy.address()}],
          links: [String.t()],
          port: 0..65_535
        }

  @most 1_100
  @latest 0xFFFFFFFFFFFFFFFF

  @doc "A beacon as a plain term for the wire."
  @spec term(t()) :: tuple()
  def term(%__MODULE__{} = beacon),
    do: {beacon.sessions, beacon.hears, beacon.links, beacon.port}

  @doc """
  A beacon from the wire.

      iex> alias Mesh.Protocol.Beacon
      iex> {:ok, beacon} = Beacon.check({[{"mag1@lab", 7}], [{"mag1@lab", {{10, 0, 0, 7}, 4370}}], [], 0})
      iex> beacon.hears
      [{"mag1@lab", {{10, 0, 0, 7}, 4370}}]
      iex> Beacon.check({[], [:mag1], [], 0})
      :error
  """
  @spec check(term()) :: {:ok, t()} | :error
  def check({sessions, hears, links, port})
      when is_list(sessions) and is_list(hears) and is_list(links) and port in 0..65_535 do
    if list?(sessions, &session?/1) and list?(hears, &heard?/1) and list?(links, &name?/1),
      do: {:ok, %__MODULE__{sessions: sessions, hears: hears, links: links, port: port}},
      else: :error
  end

  def check(_other), do: :error

  @doc """
  The beacon without names that this node does not know, because what it passes on must stay true
  and short.

      iex> alias Mesh.Protocol.Beacon
      iex> beacon = %Beacon{sessions: [{"mag1@lab", 7}, {"x@y", 8}], hears: [], links: ["x@y"], port: 0}
      iex> known = Beacon.known(beacon, %{"mag1@lab" => :mag1@lab})
      iex> {known.sessions, known.links}
      {[{"mag1@lab", 7}], []}
  """
  @spec known(t(), %{String.t() => node()}) :: t()
  def known(%__MODULE__{} = beacon, nodes) do
    %{
      beacon
      | sessions: Enum.filter(beacon.sessions, &is_map_key(nodes, elem(&1, 0))),
        hears: Enum.filter(beacon.hears, &is_map_key(nodes, elem(&1, 0))),
        links: Enum.filter(beacon.links, &is_map_key(nodes, &1))
    }
  end

  defp list?(list, fun), do: WireTerm.list?(list, fun) and length(list) <= @most

  defp session?({name, session}),
    do: name?(name) and is_integer(session) and session in 0..@latest

  defp session?(_other), do: false

  defp heard?({name, address}) do
    name?(name) and match?({{_, _, _, _}, _}, address) and Static.address(address) != :error
  end

  defp heard?(_other), do: false
  defp name?(text), do: is_binary(text) and byte_size(text) in 1..255
end
