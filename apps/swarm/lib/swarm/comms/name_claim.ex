defmodule Swarm.Comms.NameClaim do
  @moduledoc """
  A robot's claim to its name. Of two robots of one name, on whatever nodes, the one with the lower
  `{boot, node}` stays. The other leaves the directory and gives way for good.

  They find each other in the directory, where both comms processes are in one group and tell each other who
  they are, once a second; or by radio, where each hears heartbeats that are not its own.
  """
  alias Mesh.Nonblocking
  alias Swarm.Directory

  @enforce_keys [:robot, :me]
  defstruct @enforce_keys ++ [entry: nil]

  @typedoc "Who a robot is besides its name: the number of its life, and its node."
  @type identity :: {boot :: integer(), node()}
  @type t :: %__MODULE__{robot: atom(), me: identity(), entry: Directory.Membership.t() | nil}

  @doc "The name of a robot, not entered yet."
  @spec new(atom(), identity()) :: t()
  def new(robot, me), do: %__MODULE__{robot: robot, me: me}

  @doc "Enters the calling process, the robot's comms process, into the directory, now or when there is one."
  @spec enter(t()) :: t()
  def enter(%__MODULE__{robot: robot} = name),
    do: entered(name, Directory.Membership.enter([:robots, {:robot, robot}]))

  @doc "Whether a message was about the entry: it enters again when the directory has ended."
  @spec arrived(t(), message :: term()) :: {:ok, t()} | :other
  def arrived(%__MODULE__{} = name, message) do
    with {:ok, entry} <- Directory.Membership.arrived(name.entry, message),
         do: {:ok, entered(name, entry)}
  end

  @doc "The messages that it waits for and that must not get lost."
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

  @doc "Whether it has given way to another of its name."
  @spec left?(t()) :: boolean()
  def left?(%__MODULE__{entry: entry}), do: entry != nil and entry.left?

  @doc "Tells all others of this name who this one is."
  @spec challenge(t()) :: :ok
  def challenge(%__MODULE__{entry: %{left?: true}}), do: :ok

  def challenge(name) do
    for link <- Directory.members({:robot, name.robot}),
        link != self(),
        do: tell(name, link)

    :ok
  end

  @doc """
  Another of this name is there: its comms process, or `nil` where it was heard by radio. Says whether this one
  gives way by that; it has left the directory then.
  """
  @spec rival(t(), identity(), pid() | nil) :: {gives_way? :: boolean(), t()}
  def rival(%__MODULE__{entry: %{left?: true}} = name, _other, _link), do: {false, name}

  # By radio a robot may hear itself, and its former life; two on one node cannot be.
  def rival(name, {_boot, node}, nil) when node == node(), do: {false, name}

  def rival(name, other, link) do
    case judge(name.me, other) do
      :give_way ->
        {true, %{name | entry: Directory.Membership.leave(name.entry)}}

      :stay ->
        if link, do: tell(name, link)
        {false, name}

      :same ->
        {false, name}
    end
  end

  @doc """
  Which of two robots of one name is to go on.

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

  defp tell(name, link), do: Nonblocking.cast(link, {:rival, name.me, self()})
end
