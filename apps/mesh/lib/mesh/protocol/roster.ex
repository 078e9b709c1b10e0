defmodule Mesh.Protocol.Roster do
  @moduledoc false
  # Lists the names that a node may meet: its fleet's robots and the nodes without a robot, each at this node's own host
  # part. They come from the configuration and are made into atoms once, at the start; what arrives by radio is compared
  # with them as text. A node that has shown the secret may have another name of the same form (`enter/2`); so many of
  # those are let in, and no other text becomes an atom. Pure.
  #
  # All nodes of a fleet share the host part of their names, which need not be a machine's name
  # (`mag1@lab`): where a node is, is told by its beacons.

  alias Hal.RobotName

  @enforce_keys [:me, :host, :nodes, :robots]
  defstruct @enforce_keys ++ [guests: 0]

  @type t :: %__MODULE__{
          me: node(),
          host: String.t(),
          nodes: %{String.t() => node()},
          robots: MapSet.t(atom()),
          guests: non_neg_integer()
        }

  # Nodes that hold a world, a person's shell, a demo.
  @others [:world, :base, :demo]
  @most 1_000
  # Of names that are not configured.
  @most_guests 64

  @doc """
  The roster of a node, from the names of its fleet.

      iex> roster = Mesh.Protocol.Roster.new(:mag1@lab, [:mag1, :min1])
      iex> {roster.nodes["min1@lab"], roster.nodes["spy@lab"]}
      {:min1@lab, nil}
  """
  @spec new(node(), [atom()]) :: t()
  def new(me, fleet) do
    [_name, host] = me |> Atom.to_string() |> String.split("@", parts: 2)

    # From the configuration, and no more than a thousand.
    nodes = for name <- fleet ++ @others, into: %{}, do: entry("#{name}@#{host}")
    own = Atom.to_string(me)
    nodes = Map.put(nodes, own, me)
    %__MODULE__{me: me, host: host, nodes: nodes, robots: MapSet.new(fleet)}
  end

  @doc """
  The type of a configured fleet, for a table of `Hal.Options`: a list of names, which are atoms, or text in a file and in
  the environment. A configuration is this machine's own, so its text becomes atoms.
  """
  @spec type() :: Hal.Options.Type.t()
  def type,
    do:
      {:list, {:check, &__MODULE__.name/1, ~s(a robot's name such as "mag1" or "rover_2")}, @most}

  @doc false
  def name(text) when is_binary(text), do: with(:error <- RobotName.read(text), do: false)
  def name(name), do: is_atom(name) and RobotName.valid?(name)

  @doc "The node of that name, if it is known."
  @spec node(t(), String.t()) :: {:ok, node()} | :error
  def node(roster, text), do: Map.fetch(roster.nodes, text)

  @doc """
  Whether a node that is not known could be let in by its name.

      iex> roster = Mesh.Protocol.Roster.new(:mag1@lab, [:mag1])
      iex> for name <- ["laptop@lab", "base2@lab", "Laptop@lab", "laptop@hall", "rem-1@lab"],
      ...>     do: Mesh.Protocol.Roster.guest?(roster, name)
      [true, true, false, false, false]
  """
  @spec guest?(t(), String.t()) :: boolean()
  def guest?(%{guests: guests, host: host}, text) do
    case String.split(text, "@", parts: 2) do
      [name, ^host] -> guests < @most_guests and RobotName.valid?(name)
      _other -> false
    end
  end

  @doc "Lets in a node that has shown the secret, and now; one that is known is known."
  @spec enter(t(), String.t()) :: {:ok, node(), t()} | :error
  def enter(roster, text) do
    cond do
      node = roster.nodes[text] ->
        {:ok, node, roster}

      guest?(roster, text) ->
        {name, node} = entry(text)
        nodes = Map.put(roster.nodes, name, node)
        {:ok, node, %{roster | nodes: nodes, guests: roster.guests + 1}}

      true ->
        :error
    end
  end

  @doc "What changes of the node table are for the nodes of this roster."
  @spec changes(t(), [{change, String.t()}]) :: [{:node, change, node()}] when change: atom()
  def changes(roster, changes) do
    for {change, name} <- changes, {:ok, node} = node(roster, name), do: {:node, change, node}
  end

  @doc "Whether a robot belongs to the fleet."
  @spec robot?(t(), term()) :: boolean()
  def robot?(roster, id), do: is_atom(id) and MapSet.member?(roster.robots, id)

  defp entry(text), do: {text, String.to_atom(text)}
end
