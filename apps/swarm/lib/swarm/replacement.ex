defmodule Swarm.Replacement do
  @moduledoc """
  Gives robots that are under way another mission, or new code of one (`Swarm.replace/2`): they stand, change, and go
  on; what ends in its first 10 s goes back by itself.

  | part | what it does |
  |---|---|
  | `Swarm.Replacement.Order` | the order as bytes, and its signature by the fleet's key |
  | `Swarm.Replacement.Code`, `.ObjectCode` | which code may come, and how it is loaded and brought back |
  | `Swarm.Replacement.Rehearsal` | a VM that loads it first |
  | `Swarm.Replacement.Job` | one replacement on one node, as a function |
  | `Swarm.Replacement.Admission`, `.Entries` | whether an order is carried out; what is read on the boards of robots, and noted there |
  | `Swarm.Replacement.Server` | the process of a node |

  The release stays as it is: nothing is written to a disk, and a robot that starts again has its own mission, and its own
  code. On real robots it is off unless their file says `replace: true`, and code comes
  only where it says `replace: :code`, on simulated robots, too.
  """
  alias Hal.Options.Wording
  alias Robot.{Board, Role}
  alias Swarm.{Missions, Replacement}
  alias Swarm.Replacement.Order

  @doc "The process of a node, for its supervisor."
  @spec child_spec(term()) :: Supervisor.child_spec()
  def child_spec(options),
    do: %{id: __MODULE__, start: {Replacement.Server, :start_link, [options]}}

  @doc """
  The content of an order to these robots: a mission as `Swarm.start/2` takes it, `:patrol`, `{:patrol, period: 60}` or
  `"patrol:period=60"`, or `{:code, module, options}` with the code of this node's files (`Swarm.Replacement.Code.read/1`).
  The error is one line.
  """
  @spec order([atom()], term()) :: {:ok, content :: binary()} | {:error, line :: String.t()}
  def order(robots, given) do
    with {:ok, {module, options}, code} <- mission(given, length(robots)) do
      Order.encode(%Order{
        id: :crypto.strong_rand_bytes(16),
        from: Atom.to_string(node()),
        to: Enum.map(robots, &Atom.to_string/1),
        mission: Atom.to_string(module),
        options: Order.encode_options(options),
        code: code
      })
    end
  end

  defp mission({:code, source}, count), do: mission({:code, source, []}, count)

  defp mission({:code, source, options}, _count) do
    if Keyword.keyword?(options) do
      with {:ok, module, code} <- Replacement.Code.read(source),
           do: {:ok, {module, options}, code}
    else
      {:error, "options: expected [key: value, …], got #{Wording.show(options)}"}
    end
  end

  defp mission(text, count) when is_binary(text),
    do: with({:ok, mission} <- Missions.Text.read(text, count), do: {:ok, mission, []})

  defp mission(named, count),
    do: with({:ok, mission} <- Missions.choose(named, count), do: {:ok, mission, []})

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
    about = %{mission: config.mission, replace: config.replace}
    [{:put, :release, about} | if(config.replace, do: [cast(:keep)], else: [])]
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
