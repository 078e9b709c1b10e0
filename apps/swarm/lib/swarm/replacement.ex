defmodule Swarm.Replacement do
  @moduledoc """
  Gives robots that are under way another mission of their release (`Swarm.replace/2`): they stand, change, and go
  on; what ends in its first 10 s goes back by itself.

  | part | what it does |
  |---|---|
  | `Swarm.Replacement.Order` | the order as bytes, and its signature by the fleet's key |
  | `Swarm.Replacement.Job` | one replacement on one node, as a function |
  | `Swarm.Replacement.Admission`, `.Entries` | whether an order is carried out; what is read on the boards of robots, and noted there |
  | `Swarm.Replacement.Server` | the process of a node |

  No code comes along, and nothing is written to a disk: a robot that starts again has its own mission. On real robots it is
  off unless their file says `replace: true`. New code comes with a release (`rel/deploy`), or by IEx's `nl/2`.
  """
  alias Robot.{Board, Role}
  alias Swarm.{MissionRegistry, Replacement}
  alias Swarm.Replacement.Order

  @doc "The process of a node, for its supervisor."
  @spec child_spec(term()) :: Supervisor.child_spec()
  def child_spec(options),
    do: %{id: __MODULE__, start: {Replacement.Server, :start_link, [options]}}

  @doc """
  The content of an order to these robots: a mission as `Swarm.start/2` takes it, `:patrol`, `{:patrol, period: 60}` or
  `"patrol:period=60"`. The error is one line.
  """
  @spec order([atom()], term()) :: {:ok, content :: binary()} | {:error, line :: String.t()}
  def order(robots, given) do
    with {:ok, {module, options}} <- mission(given, length(robots)) do
      Order.encode(%Order{
        id: :crypto.strong_rand_bytes(16),
        from: Atom.to_string(node()),
        to: Enum.map(robots, &Atom.to_string/1),
        mission: Atom.to_string(module),
        options: Order.encode_options(options)
      })
    end
  end

  defp mission(text, count) when is_binary(text), do: MissionRegistry.Text.read(text, count)
  defp mission(named, count), do: MissionRegistry.choose(named, count)

  @doc "The request to this robot, signed by the key of this node, for the stamp that the robot has given; `nil` without a key."
  @spec seal(content :: binary(), robot :: atom(), Order.stamp()) :: tuple() | nil
  def seal(content, robot, stamp) do
    case Replacement.Server.sign(Order.signed_bytes(robot, stamp, content)) do
      {:ok, mac} -> {:replace, content, mac}
      {:error, _line} -> nil
    end
  end

  @doc "Whether a request is for the process of this module."
  @spec takes?(request :: term()) :: boolean()
  def takes?({:replace, _content, _mac}), do: true
  def takes?(_other), do: false

  @doc "The effect of a request to this robot, of which its comms has judged the stamp."
  @spec take(robot :: atom(), request :: tuple(), Order.stamp(), reference()) :: Role.effect()
  def take(robot, request, stamp, ref),
    do: cast({:take, robot, request, stamp, ref})

  @doc "The effects with which its comms starts: what the robot's config says comes on its board."
  @spec present(Robot.Config.t()) :: [Role.effect()]
  def present(config) do
    about = %{mission: config.mission, replace: config.replace, profile: config.profile}
    [{:put, :release, about}]
  end

  defp cast(message), do: {:apply, {GenServer, :cast, [Replacement.Server, message]}}

  @doc "The config with the mission that was put in the place of its own, if any."
  @spec config(Robot.Config.t(), Board.t() | Board.entries()) :: Robot.Config.t()
  def config(config, board) do
    case Board.fetch(board, :replaced, :infinity, 0) do
      {:ok, %{mission: {_module, _options} = mission}, _at_ms} -> %{config | mission: mission}
      _own -> config
    end
  end

  @doc "Whether a robot is just being given another mission; then it takes no orders that would move it."
  @spec changing?(Board.t() | Board.entries()) :: boolean()
  def changing?(board) do
    case Board.fetch(board, :replaced, :infinity, 0) do
      {:ok, %{changing?: changing?}, _at_ms} -> changing?
      :error -> false
    end
  end
end
