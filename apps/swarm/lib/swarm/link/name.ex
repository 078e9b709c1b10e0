defmodule Swarm.Link.Name do
  @moduledoc """
  A robot's claim to its name. Of two robots of one name, on whatever nodes, the one with the lower
  `{boot, node}` stays. The other leaves the directory and gives way for good.

  They find each other in the directory, where both links are in one group and tell each other who
  they are, once a second; or by radio, where each hears heartbeats that are not its own.
  """
  alias Swarm.{Directory, Post}
  alias Swarm.Link.Presence

  @enforce_keys [:robot, :me, :presence]
  defstruct @enforce_keys

  @typedoc "Who a robot is besides its name: the number of its life, and its node."
  @type identity :: {boot :: integer(), node()}
  @type t :: %__MODULE__{robot: atom(), me: identity(), presence: Presence.t()}

  @doc "The name of a robot, not entered yet."
  @spec new(atom(), identity()) :: t()
  def new(robot, me),
    do: %__MODULE__{robot: robot, me: me, presence: Presence.new([:robots, {:robot, robot}])}

  @doc "Enters the calling process, the robot's link, into the directory, now or when there is one."
  @spec enter(t()) :: t()
  def enter(%__MODULE__{} = name) do
    {in?, presence} = Presence.enter(name.presence)
    if in?, do: challenge(name)
    %{name | presence: presence}
  end

  @doc "A monitored process ended: it enters again if that was the directory."
  @spec down(t(), reference()) :: {:ok, t()} | :error
  def down(%__MODULE__{} = name, ref) do
    with {:ok, presence} <- Presence.down(name.presence, ref),
         do: {:ok, %{name | presence: presence}}
  end

  @doc "Tells all others of this name who this one is."
  @spec challenge(t()) :: :ok
  def challenge(%__MODULE__{presence: %{left?: true}}), do: :ok

  def challenge(name) do
    for link <- Directory.members({:robot, name.robot}),
        link != self(),
        do: tell(name, link)

    :ok
  end

  @doc """
  Another of this name is there: its link, or `nil` where it was heard by radio. Says whether this one
  gives way by that; it has left the directory then.
  """
  @spec rival(t(), identity(), pid() | nil) :: {gives_way? :: boolean(), t()}
  def rival(%__MODULE__{presence: %{left?: true}} = name, _other, _link), do: {false, name}

  # By radio a robot may hear itself, and its former life; two on one node cannot be.
  def rival(name, {_boot, node}, nil) when node == node(), do: {false, name}

  def rival(name, other, link) do
    case judge(name.me, other) do
      :give_way ->
        {true, %{name | presence: Presence.leave(name.presence)}}

      :stay ->
        if link, do: tell(name, link)
        {false, name}

      :same ->
        {false, name}
    end
  end

  @doc """
  Which of two robots of one name is to go on.

      iex> Swarm.Link.Name.judge({5, :mag1@a}, {7, :mag1@b})
      :stay
      iex> Swarm.Link.Name.judge({7, :mag1@b}, {7, :mag1@a})
      :give_way
      iex> Swarm.Link.Name.judge({7, :mag1@b}, {7, :mag1@b})
      :same
  """
  @spec judge(mine :: identity(), other :: identity()) :: :stay | :give_way | :same
  def judge(same, same), do: :same
  def judge(mine, other), do: if(mine < other, do: :stay, else: :give_way)

  defp tell(name, link), do: Post.cast(link, {:rival, name.me, self()})
end
