defmodule Swarm.Comms.NameClaim do
  @moduledoc false
  # Settles a robot's claim to its name. Of two robots with the same name, on any nodes, the one with the
  # lower `{boot, node}` stays. The other leaves the directory and gives way, until the first has
  # been neither heard nor found in the directory for 10 s: perhaps it never existed, and somebody
  # only said so.
  #
  # They find each other in the directory, where both comms processes are in the same group and tell
  # each other who they are once a second, or through the mesh, where each hears heartbeats that are
  # not its own.
  alias Mesh.Nonblocking
  alias Swarm.Directory

  @enforce_keys [:robot, :me]
  defstruct @enforce_keys ++ [entry: nil, rival_ms: nil]

  @absent_ms 10_000

  @typedoc "The identity of a robot besides its name: the number of its life, and its node."
  @type identity :: {boot :: integer(), node()}
  @typedoc "It gave way to a robot that was last heard at `rival_ms`, by the robot's own clock."
  @type t :: %__MODULE__{
          robot: atom(),
          me: identity(),
          entry: Directory.Membership.t() | nil,
          rival_ms: integer() | nil
        }

  @doc "The claim of a robot that is not in the directory yet."
  @spec new(atom(), identity()) :: t()
  def new(robot, me), do: %__MODULE__{robot: robot, me: me}

  @doc """
  Enters the calling process, which is the robot's comms process, into the directory, now or when
  there is one.
  """
  @spec enter(t()) :: t()
  def enter(%__MODULE__{robot: robot} = name),
    do: entered(name, Directory.Membership.enter([:robots, {:robot, robot}]))

  @doc "Handles a message if it was about the entry: enters again when the directory has ended."
  @spec arrived(t(), message :: term()) :: {:ok, t()} | :other
  def arrived(%__MODULE__{} = name, message) do
    with {:ok, entry} <- Directory.Membership.arrived(name.entry, message),
         do: {:ok, entered(name, entry)}
  end

  @doc "The messages that it waits for, and that must not be dropped."
  @spec timers(t()) :: [term()]
  def timers(%__MODULE__{entry: entry}),
    do: for(one <- List.wrap(entry), do: Directory.Membership.timer(one))

  defp entered(%{entry: before} = name, entry) do
    name = %{name | entry: entry}

    if Directory.Membership.in?(entry) and
         not (before != nil and Directory.Membership.in?(before)),
       do: challenge(name)

    name
  end

  @doc "Whether the robot has given way to another of its name."
  @spec left?(t()) :: boolean()
  def left?(%__MODULE__{entry: entry}), do: entry != nil and entry.left?

  @doc "Tells all others of the same name the identity of this robot."
  @spec challenge(t()) :: :ok
  def challenge(%__MODULE__{entry: %{left?: true}}), do: :ok

  def challenge(name) do
    for comms <- Directory.members({:robot, name.robot}),
        comms != self(),
        do: tell(name, comms)

    :ok
  end

  @doc """
  There is another robot of the same name: `comms` is its comms process, or `nil` if it was heard
  through the mesh. Returns whether this robot gives way; it has left the directory then.
  """
  @spec rival(t(), identity(), pid() | nil, now_ms :: integer()) ::
          {gives_way? :: boolean(), t()}
  # Through the mesh a robot may hear itself and its former life; one node cannot have two.
  def rival(name, {_boot, node}, nil, _now_ms) when node == node(), do: {false, name}

  def rival(name, other, comms, now_ms) do
    case {judge(name.me, other), left?(name)} do
      {:give_way, true} ->
        {false, %{name | rival_ms: now_ms}}

      {:give_way, false} ->
        {true, %{name | entry: Directory.Membership.leave(name.entry), rival_ms: now_ms}}

      {:stay, false} when comms != nil ->
        tell(name, comms)
        {false, name}

      _stays_or_same ->
        {false, name}
    end
  end

  @doc """
  Takes the name back if nobody else has it any more; returns whether it did. Called now and then.
  """
  @spec take_back(t(), now_ms :: integer()) :: {back? :: boolean(), t()}
  def take_back(%__MODULE__{entry: %{left?: true}, rival_ms: rival_ms} = name, now_ms)
      when now_ms - rival_ms >= @absent_ms do
    case Directory.members({:robot, name.robot}) do
      [] -> {true, enter(%{name | entry: nil, rival_ms: nil})}
      # Known by the directory alone.
      [_other | _] -> {false, %{name | rival_ms: now_ms}}
    end
  end

  def take_back(name, _now_ms), do: {false, name}

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

  defp tell(name, comms), do: Nonblocking.cast(comms, {:rival, name.me, self()})
end
