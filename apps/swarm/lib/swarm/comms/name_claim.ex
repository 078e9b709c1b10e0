defmodule Swarm.Comms.NameClaim do
  @moduledoc false
  # Settles a robot's claim to its name, with the effects of its comms (`t:Robot.Role.effect/0`). Of two robots with the same
  # name, on any nodes, the one with the
  # lower `{boot, node}` stays. The other leaves the directory and gives way, until the first has
  # been neither heard nor found in the directory for 10 s: perhaps it never existed, and a message
  # only claimed so. Pure.
  #
  # They find each other in the directory, where both comms processes are in the same group and tell
  # each other their identities once a second, or through the mesh, where each hears heartbeats that are
  # not its own.
  alias Mesh.Nonblocking
  alias Robot.Role
  alias Swarm.{Directory, EStop}

  @enforce_keys [:robot, :me]
  defstruct @enforce_keys ++ [left?: false, rival_ms: nil]

  @absent_ms 10_000

  @typedoc "The identity of a robot besides its name: the number of its life, and its node."
  @type identity :: {boot :: integer(), node()}
  @typedoc "It has `left?` its name to a robot that was last heard at `rival_ms`, by the robot's own clock."
  @type t :: %__MODULE__{
          robot: atom(),
          me: identity(),
          left?: boolean(),
          rival_ms: integer() | nil
        }

  @doc "The claim of a robot that has the name as far as it knows."
  @spec new(robot :: atom(), identity()) :: t()
  def new(robot, me), do: %__MODULE__{robot: robot, me: me}

  @doc """
  There is another robot of the same name: `comms` is its comms process, or `nil` if it was heard
  through the mesh. This one gives way, or tells the other that it stays, or nothing changes.
  """
  @spec rival(t(), identity(), pid() | nil, now_ms :: integer()) :: {t(), [Role.effect()]}
  # Through the mesh a robot may hear itself and its former life; one node cannot have two.
  def rival(%{me: {_mine, node}} = name, {_boot, node}, nil, _now_ms), do: {name, []}

  def rival(name, {_boot, node} = other, comms, now_ms) do
    case judge(name.me, other) do
      :give_way when name.left? ->
        {%{name | rival_ms: now_ms}, []}

      :give_way ->
        told = {:event, [:swarm, :comms, :duplicate_id], %{other: node}}
        effects = present(name.robot, false) ++ [{:cast, :pilot, {:halt, nil, nil}}, told]
        {%{name | left?: true, rival_ms: now_ms}, effects}

      :stay when not name.left? and comms != nil ->
        {name, [{:apply, {__MODULE__, :tell, [comms, name.me]}}]}

      _stays_or_same ->
        {name, []}
    end
  end

  @doc """
  Tells all others of the same name its identity, or takes the name back if no other robot has it any more. Called once
  a second; `taken?` says whether the directory knows another.
  """
  @spec look(t(), taken? :: boolean(), now_ms :: integer()) :: {t(), [Role.effect()]}
  def look(%__MODULE__{left?: false} = name, _taken?, _now_ms),
    do: {name, [{:apply, {__MODULE__, :challenge, [name.robot, name.me]}}]}

  def look(%{rival_ms: rival_ms} = name, _taken?, now_ms) when now_ms - rival_ms < @absent_ms,
    do: {name, []}

  def look(name, true, now_ms), do: {%{name | rival_ms: now_ms}, []}

  # It stands until it gets an order.
  def look(%{robot: robot} = name, false, _now_ms) do
    told = {:event, [:swarm, :comms, :unique_id], %{}}
    {%{name | left?: false, rival_ms: nil}, present(robot, true) ++ [told]}
  end

  defp present(robot, present?) do
    [
      {:apply, {Directory.Entry, :present, [robot, :comms, present?]}},
      {:apply, {EStop, :present, [robot, present?]}}
    ]
  end

  @doc false
  def challenge(robot, me) do
    for comms <- Directory.members({:robot, robot}), comms != self(), do: tell(comms, me)
    :ok
  end

  @doc false
  def tell(comms, me), do: Nonblocking.cast(comms, {:rival, me, self()})

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
