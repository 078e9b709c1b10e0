defmodule Swarm.Comms.NameClaim do
  @moduledoc false
  # Settles a robot's claim to its name. Of two robots with the same name, on any nodes, the one with the
  # lower `{boot, node}` stays. The other leaves the directory and gives way, until the first has
  # been neither heard nor found in the directory for 10 s: perhaps it never existed, and somebody
  # only said so. Pure.
  #
  # They find each other in the directory, where both comms processes are in the same group and tell
  # each other who they are once a second, or through the mesh, where each hears heartbeats that are
  # not its own.

  @enforce_keys [:me]
  defstruct @enforce_keys ++ [left?: false, rival_ms: nil]

  @absent_ms 10_000

  @typedoc "The identity of a robot besides its name: the number of its life, and its node."
  @type identity :: {boot :: integer(), node()}
  @typedoc "It has `left?` its name to a robot that was last heard at `rival_ms`, by the robot's own clock."
  @type t :: %__MODULE__{me: identity(), left?: boolean(), rival_ms: integer() | nil}

  @doc "The claim of a robot that has the name as far as it knows."
  @spec new(identity()) :: t()
  def new(me), do: %__MODULE__{me: me}

  @doc """
  There is another robot of the same name: `comms` is its comms process, or `nil` if it was heard
  through the mesh. Returns whether this robot gives way, stays and tells the other, or only stays as it is.
  """
  @spec rival(t(), identity(), pid() | nil, now_ms :: integer()) ::
          {:give_way | :tell | :stay, t()}
  # Through the mesh a robot may hear itself and its former life; one node cannot have two.
  def rival(%{me: {_mine, node}} = name, {_boot, node}, nil, _now_ms), do: {:stay, name}

  def rival(name, other, comms, now_ms) do
    case judge(name.me, other) do
      :give_way when name.left? -> {:stay, %{name | rival_ms: now_ms}}
      :give_way -> {:give_way, %{name | left?: true, rival_ms: now_ms}}
      :stay when not name.left? and comms != nil -> {:tell, name}
      _stays_or_same -> {:stay, name}
    end
  end

  @doc """
  Takes the name back if no other robot has it any more; returns whether it did. `taken?` says whether the directory
  knows another.
  """
  @spec take_back(t(), taken? :: boolean(), now_ms :: integer()) :: {back? :: boolean(), t()}
  def take_back(%__MODULE__{left?: true, rival_ms: rival_ms} = name, taken?, now_ms)
      when now_ms - rival_ms >= @absent_ms do
    if taken?,
      do: {false, %{name | rival_ms: now_ms}},
      else: {true, %{name | left?: false, rival_ms: nil}}
  end

  def take_back(name, _taken?, _now_ms), do: {false, name}

  @doc """
  Which of two robots with the same name goes on.

      iex> Swarm.Comms.NameClaim.judge({5, :mag1@a}, {7, :mag1@b})
      :stay
      iex> Swarm.Comms.NameClaim.judge({7, :mag1@b}, {7, :mag1@a})
      :give_way
      iex> Swarm.Comms.NameClaim.judge({7, :mag1@b}, {7, :mag1@b})
      :same
  """
  @spec judge(mine :: identity(), other :: identity()) :: :stay | :give_way | :same
  def judge(same, same), do: :same
  def judge(mine, other), do: if(mine < other, do: :stay, else: :give_way)
end
